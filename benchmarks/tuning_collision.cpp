// The effect of each number of collision/src/tuning.h, halved and doubled, on fixed scenes; of a cosine or sine
// that stands for an angle, the angle. See README.md.
//
//   build/benchmark/bin/tuning_collision > table.md
//
// Prints a Markdown table.
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "cpu_time.h"
#include "finder_scenes.h"
#include "limber/collision/broad_phase.h"
#include "limber/collision/tree_traversal.h"
#include "limber/dynamics/body_group.h"
#include "limber/tet_overlap/tet_overlap_normals.h"
#include "manifold/time_of_impact.h"
#include "narrow_phase_reference.h"
#include "random_states.h"
#include "scoped_value.h"
#include "sheet_model.h"
#include "tuning.h"
#include "tuning_collision_pairs.h"
#include "wavy_model.h"

namespace limber {
namespace {

using internal::CollisionTuning;
using testing::Random;

// -- The numbers ------------------------------------------------------------------------------------------------------

struct Number {
  std::string room, name;
  std::function<void(CollisionTuning&, double)> multiply;
};

double multiplied(double x, double factor) { return x * factor; }
/// A cosine or sine whose angle is multiplied, and a share whose distance from 1 is.
double angle_of_cosine(double x, double factor) { return std::cos(factor * std::acos(x)); }
double angle_of_sine(double x, double factor) { return std::sin(factor * std::asin(x)); }
double rest_to_one(double x, double factor) { return 1.0 - factor * (1.0 - x); }
/// Half way to 0 or to 1.
double between_bounds(double x, double factor) { return factor < 1.0 ? 0.5 * x : 0.5 * (1.0 + x); }

#define LIMBER_NUMBER_BY(room, name, change)                                      \
  Number {                                                                        \
#room, #name, [](CollisionTuning& t, double factor) {                           \
      using T = decltype(t.room.name);                                              \
      t.room.name = static_cast<T>(change(static_cast<double>(t.room.name), factor)); \
    } \
  }
#define LIMBER_NUMBER(room, name) LIMBER_NUMBER_BY(room, name, multiplied)

const std::vector<Number> kNumbers{
    LIMBER_NUMBER(broad, moves_before_sort),
    LIMBER_NUMBER(broad, rows_per_chunk),
    LIMBER_NUMBER(convex, hull_thickness),
    LIMBER_NUMBER(convex, hull_same_direction),
    LIMBER_NUMBER(convex, parallel_lines),
    LIMBER_NUMBER(convex, gjk_progress),
    LIMBER_NUMBER(convex, gjk_iterations),
    LIMBER_NUMBER_BY(convex, face_alignment, angle_of_cosine),
    LIMBER_NUMBER(convex, reference_preference),
    LIMBER_NUMBER_BY(convex, edge_preference, rest_to_one),
    LIMBER_NUMBER(convex, least_cross),
    LIMBER_NUMBER(convex, most_face_tests),
    LIMBER_NUMBER(convex, side_by_side),
    LIMBER_NUMBER(narrow, touching),
    LIMBER_NUMBER(narrow, flat),
    LIMBER_NUMBER(narrow, leaning),
    LIMBER_NUMBER_BY(narrow, steep, angle_of_sine),
    LIMBER_NUMBER(narrow, passed),
    LIMBER_NUMBER(narrow, rocking),
    LIMBER_NUMBER(narrow, leads_into),
    LIMBER_NUMBER(narrow, aligned_depth),
    LIMBER_NUMBER_BY(narrow, same_way, angle_of_cosine),
    LIMBER_NUMBER(narrow, directionless),
    LIMBER_NUMBER(narrow, parallel_touching),
    LIMBER_NUMBER(narrow, grazing),
    LIMBER_NUMBER(narrow, rest_depth_steps),
    LIMBER_NUMBER(narrow, least_stretch),
    LIMBER_NUMBER(narrow, least_patch),
    LIMBER_NUMBER(finder, unit_quaternion),
    LIMBER_NUMBER(finder, pairs_per_chunk),
    LIMBER_NUMBER(finder, bodies_per_chunk),
    LIMBER_NUMBER_BY(impact, kept_gap, between_bounds),
    LIMBER_NUMBER(impact, good_advancement),
    LIMBER_NUMBER(impact, look_nearer),
    LIMBER_NUMBER(impact, look_again),
    LIMBER_NUMBER(impact, look_farther),
    LIMBER_NUMBER(impact, visits_of_a_look),
    LIMBER_NUMBER(impact, fine_doubt),
    LIMBER_NUMBER(impact, most_advancements),
    LIMBER_NUMBER_BY(impact, worth_a_look, between_bounds),
};

// -- What comes out ---------------------------------------------------------------------------------------------------

using Contacts = std::vector<ContactPoint>;

/// All answers with one tuning, and what the references say of them.
struct Outcome {
  std::vector<Contacts> contacts;  // by query
  std::vector<double> times;       // of impact, s
  long advancements = 0;
  int missed = 0, extra = 0, wrong = 0;
  double worst_gap = 0.0, worst_normal = 0.0;
};

class Scenes {
 public:
  Scenes() : pairs_(surface_pairs()) {
    convex_from_ = pairs_.size();
    for (TuningPair& pair : convex_pairs()) pairs_.push_back(std::move(pair));
    make_shots();
    make_crossing_boxes();
  }

  Outcome answer() {
    Outcome r;
    for (const TuningPair& pair : pairs_) {
      r.contacts.push_back(contacts_of(pair));
      judge(pair, r.contacts.back(), r);
    }
    ask_heap(&r.contacts);
    for (const Shot& shot : shots_) {
      const internal::ImpactTime t = shoot(shot);
      r.times.push_back(t.status == internal::ImpactTime::Status::kImpact ? t.time : kStep);
      r.advancements += t.advancements;
    }
    return r;
  }

  /// CPU time of a room's scenes, s.
  double seconds(const std::string& room) {
    LeastTime time;
    for (int i = 0; i < 4; ++i) time.measure([&] { run(room); });
    return time.seconds();
  }

 private:
  static constexpr double kStep = 1.0 / 60.0;

  struct Shot {
    internal::MovingBody sheet, ball;
    std::vector<double> z, rates;  // of the sheet
  };

  static void judge(const TuningPair& pair, const Contacts& contacts, Outcome& r) {
    if (pair.reference) {
      const testing::Comparison c = testing::compare(contacts, *pair.reference, *pair.a, *pair.b);
      r.missed += static_cast<int>(c.missed.size()), r.extra += static_cast<int>(c.extra.size());
      r.worst_gap = std::max(r.worst_gap, c.worst_gap), r.worst_normal = std::max(r.worst_normal, c.worst_normal);
    }
    if (pair.upright) {
      if (contacts.size() < (pair.margin > 0.0 && *pair.upright <= 1e-3 ? 4u : 0u)) ++r.wrong;
      for (const ContactPoint& c : contacts)
        r.wrong += std::hypot(c.normal.x(), c.normal.y()) > 1.5 * *pair.upright + 1e-7 ? 1 : 0;
    }
    if (pair.free_after)
      for (const ContactPoint& c : contacts) r.wrong += c.gap + c.normal.dot(pair.ahead) < -*pair.free_after ? 1 : 0;
  }

  Contacts contacts_of(const TuningPair& pair) {
    Contacts contacts;
    CollisionBody a = pair.a->body(0);
    a.displacement = pair.ahead;
    NarrowPhase& narrow = pair.by_tets ? tets_ : pair.overlap == OverlapMethod::kNearestPoint ? nearest_ : rest_;
    narrow.find_contacts(a, pair.b->body(1), pair.margin, Vec3::Zero(), contacts);
    return contacts;
  }

  void run(const std::string& room) {
    if (room == "broad") sweep();
    if (room == "convex")
      for (std::size_t i = convex_from_; i < pairs_.size(); ++i) contacts_of(pairs_[i]);
    if (room == "narrow")
      for (std::size_t i = 0; i < convex_from_; ++i) contacts_of(pairs_[i]);
    if (room == "finder") {
      ask_heap(nullptr);
      for (const Shot& shot : shots_) shoot(shot);
    }
  }

  /// A heap of mixed bodies and two sheets on each other that move by millimetres from query to query.
  void ask_heap(std::vector<Contacts>* all) {
    testing::ContactScene scene = testing::heap(60, 6);
    const Index below =
        scene.add(BodyGeometry{.model = sheet_, .shape = {}}, {.p = {0.0, 0.0, -20.0}}, {1e-4, 1e-4, 1e-4, 1e-4});
    scene.add(BodyGeometry{.model = sheet_, .shape = {}}, {.p = {0.3, 0.2, -20.0 + 1e-3}}, {1e-4, -1e-4, 1e-4, -1e-4});
    ContactFinder finder;
    scene.add_all_to(finder);
    for (int step = 0; step < 10; ++step) {
      for (std::size_t i = 1; i < scene.poses.size(); ++i)
        scene.poses[i].p.x() += 0.001 * std::sin(0.3 * step + static_cast<double>(i));
      for (double& z : scene.amplitudes[static_cast<std::size_t>(below)]) z = 1e-4 * std::cos(step + 1e4 * z);
      Contacts contacts;
      finder.find_contacts({.states = scene.states(), .margin = 0.005}, contacts, serial_jobs());
      if (all != nullptr) all->push_back(std::move(contacts));
    }
  }

  /// Balls at 5 to 100 m/s towards and past a vibrating sheet.
  void make_shots() {
    Random random(75);
    const auto model = testing::sheet_model(12, 8);
    const auto surface = std::make_shared<const CollisionSurface>(model);
    for (int i = 0; i < 60; ++i) {
      Shot shot{{.surface = surface, .displacement = random.vector(0.5), .rotation = random.vector(3.0)}, {}, {}, {}};
      for (const double lambda : model->data().eigenvalues) {
        shot.z.push_back(random.uniform(-1e-3, 1e-3));
        shot.rates.push_back(1e-3 * std::sqrt(lambda) * random.uniform(-1.0, 1.0));
      }
      const double speed = std::pow(10.0, random.uniform(0.7, 2.0));
      const Vec3 aim = random.vector(0.6), from = aim.cwiseProduct(Vec3(1, 1, 0)) + Vec3(0, 0, 0.6 * speed * kStep);
      shot.ball = {.geometry = &ball_,
                   .pose = {.p = from},
                   .displacement = speed * Vec3(random.uniform(-1, 1), random.uniform(-1, 1), -1.0).normalized()};
      shots_.push_back(std::move(shot));
    }
  }
  internal::ImpactTime shoot(const Shot& shot) {
    internal::MovingBody sheet = shot.sheet;
    sheet.amplitudes = shot.z, sheet.rates = shot.rates;
    return impact_.find(shot.ball, sheet, kStep, 1e-4);
  }

  void make_crossing_boxes() {
    Random random(76);
    for (int i = 0; i < 2000; ++i) places_.push_back(random.vector(7.0)), speeds_.push_back(random.vector(0.05));
  }
  /// 2,000 boxes that move by a twentieth of their size from query to query.
  void sweep() {
    BroadPhase broad;
    std::vector<BodyPair> pairs;
    for (std::size_t i = 0; i < places_.size(); ++i) broad.add(static_cast<Index>(i));
    for (int step = 0; step < 20; ++step) {
      for (std::size_t i = 0; i < places_.size(); ++i) {
        const Vec3 p = places_[i] + step * speeds_[i];
        broad.set_box(static_cast<Index>(i), {p - Vec3::Constant(0.5), p + Vec3::Constant(0.5)});
      }
      broad.find_pairs(0.0, pairs, serial_jobs());
    }
  }

  std::vector<TuningPair> pairs_;
  std::size_t convex_from_ = 0;
  std::vector<Shot> shots_;
  std::vector<Vec3> places_, speeds_;
  NarrowPhase nearest_{{.overlap = OverlapMethod::kNearestPoint}}, tets_{{.normals = tet_overlap_normals}},
      rest_{{.overlap = OverlapMethod::kRestDepth}};
  const RigidGeometry ball_{Sphere{0.01}};
  const std::shared_ptr<const ModalModel> sheet_ = testing::sheet_model(16, 4);
  internal::TimeOfImpact impact_;
};

/// How one outcome differs from another.
struct Difference {
  long contacts = 0;               // in one and not in the other
  double gap = 0.0, normal = 0.0;  // of contacts in both, m and 1
  double time = 0.0;               // of impacts, s
};

Difference difference(const Outcome& one, const Outcome& other) {
  Difference d;
  for (std::size_t q = 0; q < one.contacts.size(); ++q) {
    std::map<std::uint64_t, const ContactPoint*> known;
    for (const ContactPoint& c : one.contacts[q]) known[c.id] = &c;
    for (const ContactPoint& c : other.contacts[q]) {
      const auto same = known.find(c.id);
      if (same == known.end()) {
        ++d.contacts;
        continue;
      }
      d.gap = std::max(d.gap, std::abs(c.gap - same->second->gap));
      d.normal = std::max(d.normal, (c.normal - same->second->normal).norm());
      known.erase(same);
    }
    d.contacts += static_cast<long>(known.size());
  }
  for (std::size_t i = 0; i < one.times.size(); ++i) d.time = std::max(d.time, std::abs(one.times[i] - other.times[i]));
  return d;
}

std::string row(const std::string& name, const Outcome& r, const Difference& d, double time) {
  char text[256];
  const auto small = [](double x) {
    char number[32];
    std::snprintf(number, sizeof number, x == 0.0 ? "0" : "%.0e", x);
    return std::string(number);
  };
  std::snprintf(text, sizeof text, "| %s | %d | %d | %d | %s | %s | %ld | %s | %s | %+ld | %s | %.2f |", name.c_str(),
                r.missed, r.extra, r.wrong, small(r.worst_gap).c_str(), small(r.worst_normal).c_str(), d.contacts,
                small(d.gap).c_str(), small(d.normal).c_str(), r.advancements, small(d.time).c_str(), time);
  return text;
}

int print_table() {
  Scenes scenes;
  const Outcome usual = scenes.answer();
  const std::size_t contacts = std::accumulate(usual.contacts.begin(), usual.contacts.end(), std::size_t{0},
                                               [](std::size_t sum, const Contacts& c) { return sum + c.size(); });
  std::printf("%zu queries, %zu contacts, %zu shots, %ld advancements\n\n", usual.contacts.size(), contacts,
              usual.times.size(), usual.advancements);
  std::puts(
      "| number | missed | extra | wrong | gap | normal | changed | by gap | by normal | advancements | by time | CPU "
      "|");
  std::puts("|---|---|---|---|---|---|---|---|---|---|---|---|");
  std::puts(row("as they are", usual, {}, 1.0).c_str());
  for (const Number& number : kNumbers) {
    double usual_time = scenes.seconds(number.room);
    for (const double factor : {0.5, 2.0}) {
      CollisionTuning tuning;
      number.multiply(tuning, factor);
      double time = 0.0;
      Outcome changed;
      {
        const testing::ScopedValue in_force(internal::collision_tuning_in_use, tuning);
        changed = scenes.answer();
        time = scenes.seconds(number.room);
      }
      usual_time = std::min(usual_time, scenes.seconds(number.room));
      const Difference d = difference(usual, changed);
      changed.advancements -= usual.advancements;
      std::puts(
          row(number.room + "." + number.name + (factor < 1.0 ? " ½" : " 2"), changed, d, time / usual_time).c_str());
      std::fflush(stdout);
    }
  }
  return 0;
}

}  // namespace
}  // namespace limber

int main() { return limber::print_table(); }
