// What benchmarks of joints share: a world in which nothing touches, and parts that are asked for by name.
#pragma once

#include <cstdio>
#include <initializer_list>
#include <string>
#include <vector>

#include "limber/dynamics/contact_source.h"

namespace limber::testing {

struct NoContacts final : ContactSource {
  void add_body(Index, const BodyGeometry&, const CollisionFilter&) override {}
  void remove_body(Index) override {}
  void set_filter(Index, const CollisionFilter&) override {}
  void exclude_pair(Index, Index, bool) override {}
  void find_contacts(const ContactQuery&, std::vector<ContactPoint>& contacts, Jobs&) override { contacts.clear(); }
};

struct NamedPart {
  const char* name;
  void (*print)();
};

/// Prints one part, or all without a name. @return the program's exit code
inline int print_parts(const char* program, std::initializer_list<NamedPart> parts, const std::string& asked) {
  bool any = false;
  for (const NamedPart& part : parts)
    if (asked.empty() || asked == part.name) any = true, part.print(), std::printf("\n");
  if (any) return 0;
  std::fprintf(stderr, "%s: \"%s\", expected", program, asked.c_str());
  const char* before = " ";
  for (const NamedPart& part : parts) std::fprintf(stderr, "%s%s", before, part.name), before = ", ";
  std::fprintf(stderr, "\n");
  return 2;
}

}  // namespace limber::testing
