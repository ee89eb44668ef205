// ranges_by_booleans: ranges of motion against exact intersections of the solids (CGAL).
//   run:  build/benchmark/bin/ranges_by_booleans [--pairs N] [--only ASSEMBLY] [--verbose]
//   see:  for random pairs of prisms on every kind of path, and for the drawn assemblies in four clearances, how many ends
//         are exact: the solids are apart before and overlap at most 1e-3 beyond (rad; translations: of the smaller
//         diagonal); how many are within δ: what overlaps before them is no deeper than the δ that was told; how many
//         are wide (deeper), and how many narrow (apart as drawn, and 1e-3 beyond the end still). The depth of an
//         overlap is its volume over half of its surface. It ends with 1 if an end is wide or narrow.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/connected_components.h>
#include <CGAL/Polygon_mesh_processing/corefinement.h>
#include <CGAL/Polygon_mesh_processing/intersection.h>
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Surface_mesh.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <string_view>

#include "assemblies.h"
#include "joint_scores.h"
#include "limber/articulation/detect_joints.h"
#include "limber/articulation/range_of_motion.h"
#include "limber/core/rigid_transform.h"
#include "limber/jobs_tbb/tbb_jobs.h"

namespace limber::assemblies {
namespace {

namespace processing = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Solid = CGAL::Surface_mesh<Kernel::Point_3>;
using Kind = MotionPath::Kind;

constexpr double kPi = std::numbers::pi, kInfinity = std::numeric_limits<double>::infinity();
constexpr double kExact = 1e-3;  // rad, or of the smaller diagonal
constexpr int kPlaces = 60;      // of a range, at which solids are looked at
constexpr int kStride = 4;       // of these places, those at which the depth of an overlap is found

/// The shells of a surface, each turned outward.
std::vector<Solid> solids_of(const SurfaceMesh& surface, std::span<const Triangle> caps) {
  Solid whole;
  for (const Vec3& v : surface.vertices) whole.add_vertex({v.x(), v.y(), v.z()});
  const auto add = [&](const Triangle& t) {
    using Vertex = Solid::Vertex_index;
    whole.add_face(Vertex(t[0]), Vertex(t[1]), Vertex(t[2]));
  };
  for (const Triangle& t : surface.triangles) add(t);
  for (const Triangle& t : caps) add(t);
  std::vector<Solid> out;
  processing::split_connected_components(whole, out);
  for (Solid& shell : out)
    if (!processing::is_outward_oriented(shell)) processing::reverse_face_orientations(shell);
  return out;
}

RigidTransform motion_along(const MotionPath& path, double t) {
  const bool turns = path.kind != Kind::kTranslation;
  const Quaternion q = turns ? quaternion_from_rotation_vector(t * path.axis) : Quaternion{};
  const double advance = path.kind == Kind::kTranslation ? t : path.kind == Kind::kScrew ? path.pitch * t : 0.0;
  return {q, path.origin - q * path.origin + advance * path.axis};
}

Solid moved(const Solid& solid, const RigidTransform& motion) {
  Solid out = solid;
  for (const auto v : out.vertices()) {
    const auto& p = solid.point(v);
    const Vec3 at = motion * Vec3(p.x(), p.y(), p.z());
    out.point(v) = {at.x(), at.y(), at.z()};
  }
  return out;
}

bool boxes_overlap(const Solid& a, const Solid& b) {
  return CGAL::do_overlap(processing::bbox(a), processing::bbox(b));
}

/// Two sides of a joint, and a path of one of them.
struct Motion {
  std::vector<Solid> moving, fixed;
  MotionPath path;

  bool overlap(double t) const {
    return any_pair(t, [](const Solid& m, const Solid& f) {
      return processing::do_intersect(m, f, CGAL::parameters::do_overlap_test_of_bounded_sides(true));
    });
  }

  /// Of the deepest piece of the overlap; 0 if there is none.
  double depth(double t) const {
    double deepest = 0.0;
    any_pair(t, [&](Solid m, Solid f) {
      Solid common;
      std::vector<Solid> pieces;
      if (!processing::corefine_and_compute_intersection(m, f, common)) {
        std::printf("    no intersection at %.9g: its surface is no manifold\n", t);
        return false;
      }
      processing::split_connected_components(common, pieces);
      for (const Solid& piece : pieces)
        deepest = std::max(deepest, 2.0 * std::abs(CGAL::to_double(processing::volume(piece))) /
                                        CGAL::to_double(processing::area(piece)));
      return false;
    });
    return deepest;
  }

 private:
  template <class Test>
  bool any_pair(double t, Test&& test) const {
    const RigidTransform motion = motion_along(path, t);
    for (const Solid& still : moving) {
      const Solid m = moved(still, motion);
      for (const Solid& f : fixed)
        if (boxes_overlap(m, f) && test(m, f)) return true;
    }
    return false;
  }
};

enum class Verdict { kExact, kWithinTolerance, kWide, kNarrow };

/// @param most how far an open end is followed. @param unit by which lengths along the path are divided
Verdict judge(const Motion& motion, double told, double most, double unit, double tolerance) {
  const bool apart = !motion.overlap(0.0);
  const double end = std::isinf(told) ? std::copysign(most, told) : told;
  bool exact = true;
  for (int i = 0; i < kPlaces; ++i) {
    const double t = end * i / kPlaces;
    if (!motion.overlap(t)) continue;
    exact = false;
    if (i % kStride == 0 && motion.depth(t) > tolerance) return Verdict::kWide;
  }
  const auto overlap_beyond = [&](double by) { return motion.overlap(told + std::copysign(by * unit, told)); };
  const auto close = {1e-3 * kExact, 1e-2 * kExact, 1e-1 * kExact, kExact};  // it may be short
  if (apart && !std::isinf(told) && std::none_of(close.begin(), close.end(), overlap_beyond)) return Verdict::kNarrow;
  return exact ? Verdict::kExact : Verdict::kWithinTolerance;
}

struct Count {
  int of[4] = {};
  void add(Verdict v) { ++of[static_cast<int>(v)]; }
  int wrong() const { return of[2] + of[3]; }
  void print(const std::string& name) const {
    std::printf("%-34s %5d %7d %9d %6d %7d\n", name.c_str(), of[0] + of[1] + of[2] + of[3], of[0], of[1], of[2], of[3]);
    std::fflush(stdout);
  }
};

const char* name_of(Verdict v) {
  static const char* const kNames[] = {"exact", "within tolerance", "wide", "narrow"};
  return kNames[static_cast<int>(v)];
}

/// A prism over a regular polygon, anywhere.
SurfaceMesh random_prism(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto number = [&] { return unit(random); };
  const int n = 3 + static_cast<int>(3.0 * (number() + 1.0));
  const double radius = 0.1 + 0.1 * (number() + 1.0), half = 0.4 + 0.3 * (number() + 1.0);
  const double x = 0.7 * number(), y = 0.7 * number(), z = 0.4 * number();
  const double a = 2.0 * number(), b = 2.0 * number(), c = 2.0 * number();
  const RigidTransform place{quaternion_from_rotation_vector({a, b, c}), {x, y, z}};
  SurfaceMesh out;
  for (const double at : {-half, half})
    for (int i = 0; i < n; ++i)
      out.vertices.push_back(place *
                             Vec3(radius * std::cos(2.0 * kPi * i / n), radius * std::sin(2.0 * kPi * i / n), at));
  for (int i = 0; i < n; ++i) {
    const int j = (i + 1) % n;
    out.triangles.push_back({i, j, n + j});
    out.triangles.push_back({i, n + j, n + i});
    if (i > 1) out.triangles.push_back({0, i, i - 1});
    if (i > 1) out.triangles.push_back({n, n + i - 1, n + i});
  }
  return out;
}

Count judge_prisms(int pairs, const char* name, Kind kind, bool verbose) {
  std::mt19937 random(1);
  Count count;
  const MotionPath path{.kind = kind, .axis = Vec3::UnitZ(), .pitch = kind == Kind::kScrew ? 0.1 : 0.0};
  for (int done = 0; done < pairs;) {
    const SurfaceMesh m = random_prism(random), f = random_prism(random);
    const Motion motion{solids_of(m, {}), solids_of(f, {}), path};
    if (motion.overlap(0.0)) continue;
    ++done;
    const MotionBody moving{.surface = &m}, fixed{.surface = &f};
    const FreeMotion told = free_motion({&moving, 1}, {&fixed, 1}, path);
    for (const double end : {told.reachable.low, told.reachable.high}) {
      const Verdict v = judge(motion, end,
                              kind == Kind::kRotation ? kPi
                              : kind == Kind::kScrew  ? 30.0
                                                      : 3.0,
                              1.0, told.tolerance);
      count.add(v);
      if (verbose && v != Verdict::kExact) std::printf("    pair %d, end %.6f: %s\n", done, end, name_of(v));
    }
  }
  count.print(name);
  return count;
}

/// The path of a freedom, by the name that RangeOfMotion gives it.
MotionPath path_of(const JointSpec& joint, const std::string& freedom) {
  MotionPath out{.origin = joint.frame.origin, .axis = joint.frame.axes.col(freedom.back() - 'x').normalized()};
  if (freedom.starts_with("translation")) out.kind = Kind::kTranslation;
  if (freedom.starts_with("screw")) out.kind = Kind::kScrew, out.pitch = joint.pitch;
  return out;
}

std::vector<Solid> solids_of(const Assembly& assembly, const std::vector<Index>& components) {
  std::vector<Solid> out;
  for (const Index c : components) {
    const Component& part = assembly.components[static_cast<std::size_t>(c)];
    for (Solid& solid : solids_of(part.surface, part.caps)) out.push_back(std::move(solid));
  }
  return out;
}

void judge_assembly(const std::string& name, const Variant& variant, bool verbose, Count& count) {
  TbbJobs jobs;
  const MadeAssembly made = make(name, variant);
  const Assembly assembly = taken_apart(made);
  const auto joints = detect_joints(assembly, {}, jobs);
  const auto ranges = ranges_of_motion(assembly, joints, {}, jobs);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const auto& joint = joints[j];
    const auto part = [&](Index i) -> const Component& { return assembly.components[static_cast<std::size_t>(i)]; };
    const double size = std::min(part(joint.a).diagonal, part(joint.b).diagonal);
    const JointSides sides = joint_sides(static_cast<Index>(assembly.components.size()), joints, j);
    Motion motion{solids_of(assembly, sides.moving), solids_of(assembly, sides.fixed), {}};
    for (const FreedomRange& range : ranges[j].freedoms) {
      motion.path = path_of(joint.joint, range.freedom);
      const bool slides = motion.path.kind == Kind::kTranslation;
      for (const double end : {range.motion.reachable.low, range.motion.reachable.high}) {
        const Verdict v =
            judge(motion, end, slides ? 2.0 * made.diagonal : kPi, slides ? size : 1.0, range.motion.tolerance);
        count.add(v);
        if (verbose && v != Verdict::kExact)
          std::printf("    %s, gap %.3f: %s – %s, %s, end %.6f, tolerance %.2e: %s\n", name.c_str(), variant.clearance,
                      part(joint.a).name.c_str(), part(joint.b).name.c_str(), range.freedom.c_str(), end,
                      range.motion.tolerance, name_of(v));
      }
    }
  }
}

int run(int pairs, const std::string& only, bool verbose) {
  int wrong = 0;
  std::printf("%-34s %5s %7s %9s %6s %7s\n", "", "ends", "exact", "within δ", "wide", "narrow");
  if (only.empty()) {
    wrong += judge_prisms(pairs, "prisms that turn", Kind::kRotation, verbose).wrong();
    wrong += judge_prisms(pairs, "prisms that slide", Kind::kTranslation, verbose).wrong();
    wrong += judge_prisms(pairs, "prisms that screw", Kind::kScrew, verbose).wrong();
  }
  for (const double clearance : {0.02, 0.005, 0.0, -0.005}) {
    Count count;
    for (const auto* names : {&tuning_names(), &held_out_names()})
      for (const std::string& name : *names)
        if (only.empty() || only == name)
          judge_assembly(name, {.segments = 32, .clearance = clearance}, verbose, count);
    char text[64];
    std::snprintf(text, sizeof text, "drawn assemblies, gap %.1f %%", 100.0 * clearance);
    count.print(text);
    wrong += count.wrong();
  }
  return wrong > 0 ? 1 : 0;
}

}  // namespace
}  // namespace limber::assemblies

int main(int argc, char** argv) {
  int pairs = 200;
  bool verbose = false;
  std::string only;
  for (int i = 1; i < argc; ++i) {
    const std::string_view arg = argv[i];
    if (arg == "--verbose")
      verbose = true;
    else if (arg == "--pairs" && i + 1 < argc)
      pairs = std::atoi(argv[++i]);
    else if (arg == "--only" && i + 1 < argc)
      only = argv[++i];
    else
      return std::fprintf(stderr, "ranges_by_booleans: seen \"%s\", expected --pairs N, --only ASSEMBLY or --verbose\n",
                          argv[i]),
             2;
  }
  return limber::assemblies::run(pairs, only, verbose);
}
