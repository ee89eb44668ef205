// Another game in miniature: has its own dynamics, and asks limber only where its bodies touch.
// Exit code 0 if a box on the floor has its four corners as contacts.

#include <limber/collision/contact_finder.h>

#include <array>
#include <cmath>
#include <cstdio>

int main() {
  limber::ContactFinder finder;
  finder.add_body(0, {.shape = std::make_shared<limber::Shape>(limber::HalfSpace{})}, {});
  finder.add_body(1, {.shape = std::make_shared<limber::Shape>(limber::Box{{0.5, 0.4, 0.3}})}, {});
  const std::array states{limber::BodyState{}, limber::BodyState{.pose = {.p = {0.0, 0.0, 0.299}}}};
  std::vector<limber::ContactPoint> contacts;
  finder.find_contacts({.states = states, .margin = 0.01}, contacts, limber::serial_jobs());
  bool corners = contacts.size() == 4;
  for (const auto& c : contacts) {
    std::printf("contact of %d and %d, gap %g\n", c.a.body, c.b.body, c.gap);
    corners = corners && std::abs(c.gap + 0.001) < 1e-12 && std::abs(std::abs(c.position.x()) - 0.5) < 1e-12;
  }
  return corners ? 0 : 1;
}
