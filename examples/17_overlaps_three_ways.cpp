// 17_overlaps_three_ways: which way out of an overlap do limber, tetrahedra and FCL tell?
//   bake:  scripts/make-bar 0.2 0.2 0.2 4 4 4 > box.mesh
//          limber-precompute box.mesh --youngs-modulus 1e7 --poisson-ratio 0.4 --density 1100 --damping-ratio 0.03@100,1000
//            --modes 8 --volume -o box.glb
//   run:   17_overlaps_three_ways box.glb
//   see:   two boxes, one pushed into the top of the other beside its middle, deeper and deeper: the deepest contact. At
//          9 cm the nearest point, which FCL's contacts take, is on a side; tetrahedra lead up and outwards at every depth
//   next:  docs/papers.md
#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <memory>
#include <vector>

#include "limber/collision/contact_finder.h"
#include "limber/core/error.h"
#include "limber/core/jobs.h"
#include "limber/model/asset.h"
#include "limber/tet_overlap/tet_overlap_normals.h"
#if LIMBER_HAS_FCL
#include "limber/collision_fcl/fcl_contact_source.h"
#endif

namespace {

void tell(const char* name, limber::ContactSource& source, const std::shared_ptr<const limber::ModalModel>& box,
          double depth) {
  constexpr double kHeight = 0.2, kBeside = 0.06;
  const std::vector<double> z(static_cast<std::size_t>(box->modes()), 0.0);
  const std::array<limber::BodyState, 2> states{
      limber::BodyState{.amplitudes = z},
      limber::BodyState{.pose = {.p = {kBeside, 0.01, kHeight - depth}}, .amplitudes = z}};
  for (limber::Index i = 0; i < 2; ++i) source.add_body(i, {.model = box}, {});
  std::vector<limber::ContactPoint> contacts;
  source.find_contacts({.states = states, .margin = 0.0}, contacts, limber::serial_jobs());
  const auto deepest = std::ranges::min_element(contacts, {}, &limber::ContactPoint::gap);
  if (deepest == contacts.end()) throw limber::InvalidArgument("no contact was found");
  std::printf("%-10s %4.1f cm deep: %2zu contacts, the deepest %.4f m along (%+.2f, %+.2f, %+.2f)\n", name, 100 * depth,
              contacts.size(), -deepest->gap, -deepest->normal.x(), -deepest->normal.y(), -deepest->normal.z());
}

}  // namespace

int main(int argc, char** argv) try {
  const auto box = limber::read_asset(argc > 1 ? argv[1] : "box.glb").bodies.at(0);
  for (const double depth : {0.01, 0.05, 0.09}) {
    limber::ContactFinder own, by_tets({.normals = limber::tet_overlap_normals});
    tell("limber", own, box, depth);
    tell("tetrahedra", by_tets, box, depth);
#if LIMBER_HAS_FCL
    limber::FclContactSource fcl;
    tell("FCL", fcl, box, depth);
#endif
  }
} catch (const std::exception& e) {
  std::fprintf(stderr, "17_overlaps_three_ways: %s\n", e.what());
  return 1;
}
