// Contacts by distance fields beside ContactFinder's on the same states of a heap: time, and what of the
// exact contacts the fields miss. The heap is made by moving bodies apart along the fields' own contacts and towards
// the middle, so that what these miss is there more often than in a world. Prints Markdown.
//   field_contacts BODIES STATES ASSET.glb…     assets take turns
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <memory>
#include <random>
#include <vector>

#include "cpu_time.h"
#include "field/field_contacts.h"
#include "limber/collision/broad_phase.h"
#include "limber/collision/contact_finder.h"
#include "limber/core/quaternion.h"
#include "limber/model/asset.h"

namespace limber::testing {
namespace {

using internal::DeformedPointshell;
using internal::FieldContacts;
using internal::Pointshell;

constexpr double kMargin = 1e-3, kBends = 0.005;

/// Bodies of a few models, bent and turned at random.
class Heap {
 public:
  Heap(const std::vector<std::shared_ptr<const ModalModel>>& models, int bodies) {
    std::vector<std::shared_ptr<const Pointshell>> shells;
    for (const auto& model : models) {
      const double start = thread_seconds();
      shells.push_back(std::make_shared<const Pointshell>(std::make_shared<const CollisionSurface>(model)));
      const Pointshell& s = *shells.back();
      std::printf("| %s | %d | %d | %.2f | %.2f | %.0f | %s |\n", model->name().c_str(), s.surface().vertices(),
                  s.modes(), 1e3 * s.cell(), thread_seconds() - start, 1e-3 * static_cast<double>(s.bytes()),
                  s.resolved() ? "" : "not resolved");
      if (!s.resolved()) std::exit(1);
    }
    const int side = static_cast<int>(std::ceil(std::cbrt(bodies)));
    // Bodies of one model stand next to each other, as their coordinates are computed together.
    for (int i = 0; i < bodies; ++i) {
      const auto kind = static_cast<std::size_t>(i) * models.size() / static_cast<std::size_t>(bodies);
      kinds_.push_back(models[kind]);
      shells_.push_back(DeformedPointshell(shells[kind]));
      turns_.push_back(quaternion_from_rotation_vector(vector(3.0)));
      places_.push_back(i);
      amplitudes_.emplace_back();
      finder_.add_body(i, {.model = models[kind]}, {});
      broad_.add(i);
    }
    std::shuffle(places_.begin(), places_.end(), random_);
    for (int i = 0; i < bodies; ++i) {
      const int at = places_[static_cast<std::size_t>(i)];
      positions_.push_back(0.22 * Vec3(at % side, at / side % side, at / side / side));
    }
    for (DeformedPointshell& shell : shells_) all_.push_back(&shell);
    bend();
  }

  /// Towards the middle, and out of each other by the contacts of the fields.
  void settle(int passes) {
    for (int pass = 0; pass < passes; ++pass) {
      find_by_fields();
      std::vector<Vec3> moves(positions_.size(), Vec3::Zero());
      std::vector<int> counts(positions_.size(), 0);
      Vec3 middle = Vec3::Zero();
      for (const Vec3& p : positions_) middle += p / static_cast<double>(positions_.size());
      for (const ContactPoint& c : by_fields) {
        if (c.gap >= 0.0) continue;
        const auto a = static_cast<std::size_t>(c.a.body), b = static_cast<std::size_t>(c.b.body);
        moves[a] -= 0.5 * c.gap * c.normal, moves[b] += 0.5 * c.gap * c.normal;
        ++counts[a], ++counts[b];
      }
      for (std::size_t i = 0; i < positions_.size(); ++i)
        positions_[i] += 1.5 / std::max(1, counts[i]) * moves[i] + 0.004 * (middle - positions_[i]).normalized();
    }
  }
  void bend() {
    for (std::size_t i = 0; i < shells_.size(); ++i) {
      const ModalModel& model = *kinds_[i];
      amplitudes_[i].clear();
      for (Index m = 0; m < model.modes(); ++m)
        amplitudes_[i].push_back(kBends * model.collision_extent().radius /
                                 model.collision_extent().shape[static_cast<std::size_t>(m)] * about(1.0) / (1.0 + m));
      shells_[i].set_amplitudes(amplitudes_[i]);
    }
  }
  double find_by_fields() {
    const double start = thread_seconds();
    deform(all_, serial_jobs());
    deformed += thread_seconds() - start;
    for (std::size_t i = 0; i < shells_.size(); ++i) {
      const Vec3 low = shells_[i].low().cast<double>(), high = shells_[i].high().cast<double>();
      const Vec3 centre = turns_[i] * Vec3(0.5 * (low + high)) + positions_[i],
                 half = to_matrix(turns_[i]).cwiseAbs() * (0.5 * (high - low));
      broad_.set_box(static_cast<Index>(i), {centre - half, centre + half});
    }
    broad_.find_pairs(kMargin, pairs, serial_jobs());
    by_fields.clear();
    touching = 0;
    for (const BodyPair& pair : pairs) {
      const std::size_t before = by_fields.size();
      find_pair(pair);
      touching += by_fields.size() > before ? 1 : 0;
    }
    return thread_seconds() - start;
  }
  double find_exactly() {
    std::vector<BodyState> states;
    for (std::size_t i = 0; i < shells_.size(); ++i)
      states.push_back({.pose = {turns_[i], positions_[i]}, .amplitudes = amplitudes_[i]});
    const double start = thread_seconds();
    finder_.find_contacts({.states = states, .margin = kMargin}, exact, serial_jobs());
    return thread_seconds() - start;
  }

  std::vector<ContactPoint> by_fields, exact;
  std::vector<BodyPair> pairs;
  int touching = 0;
  double deformed = 0.0;

 private:
  double about(double size) { return std::uniform_real_distribution<double>(-size, size)(random_); }
  Vec3 vector(double size) { return {about(size), about(size), about(size)}; }
  void find_pair(const BodyPair& pair) {
    const auto a = static_cast<std::size_t>(pair.a), b = static_cast<std::size_t>(pair.b);
    const Quaternion to_a = turns_[a].conjugate();
    const RigidTransform X_AB{to_a * turns_[b], to_a * (positions_[b] - positions_[a])};
    for (const auto& c : fields_.find({&shells_[a], nullptr}, {&shells_[b], nullptr}, X_AB, kMargin)) {
      ContactPoint point;
      point.a = {pair.a, c.of[0].triangle, c.of[0].weight, c.of[0].point};
      point.b = {pair.b, c.of[1].triangle, c.of[1].weight, c.of[1].point};
      point.normal = turns_[a] * c.normal, point.gap = c.gap, point.id = c.id();
      point.position = turns_[a] * Vec3(c.of[0].point - 0.5 * c.gap * c.normal) + positions_[a];
      by_fields.push_back(point);
    }
  }

  std::mt19937 random_{5};
  std::vector<std::shared_ptr<const ModalModel>> kinds_;
  std::vector<DeformedPointshell> shells_;
  std::vector<DeformedPointshell*> all_;
  std::vector<Quaternion> turns_;
  std::vector<Vec3> positions_;
  std::vector<int> places_;
  std::vector<std::vector<double>> amplitudes_;
  ContactFinder finder_;
  FieldContacts fields_;
  BroadPhase broad_;
};

bool is_edge_on_edge(const ContactPoint& c) {
  const auto inner = [](const ContactSide& side) {
    return std::ranges::count_if(side.weight, [](double w) { return w > 1e-9; });
  };
  return inner(c.a) == 2 && inner(c.b) == 2;
}

/// What of exact contacts has none like it: of the same pair, within 30 mm, of a normal within 45° and a third of the
/// depth.
struct Misses {
  static constexpr double kDepths[] = {0.2e-3, 1e-3, 3e-3};
  int of[2][3] = {}, missed[2][3] = {}, other_way[2][3] = {}, pairs[3] = {}, unseen[3] = {};
  double worst_unseen = 0.0;

  void compare(const std::vector<ContactPoint>& exact, const std::vector<ContactPoint>& found) {
    std::map<std::pair<Index, Index>, std::pair<double, double>> depths;
    std::multimap<std::pair<Index, Index>, const ContactPoint*> of_pair;
    for (const ContactPoint& c : found) {
      of_pair.emplace(std::pair(c.a.body, c.b.body), &c);
      auto& depth = depths[{c.a.body, c.b.body}].second;
      depth = std::max(depth, -c.gap);
    }
    for (const ContactPoint& c : exact) {
      auto& depth = depths[{c.a.body, c.b.body}].first;
      depth = std::max(depth, -c.gap);
      const auto [first, last] = of_pair.equal_range({c.a.body, c.b.body});
      const bool like = std::any_of(first, last, [&](const auto& entry) {
        const ContactPoint& o = *entry.second;
        return (o.position - c.position).norm() < 0.03 && o.normal.dot(c.normal) > 0.7 && -o.gap > 0.3 * -c.gap;
      });
      const auto same_point = [](const ContactSide& one, const ContactSide& other) {
        return (one.point_B - other.point_B).norm() < 1e-4;
      };
      const bool found_at_all = std::any_of(first, last, [&](const auto& entry) {
        return same_point(entry.second->a, c.a) || same_point(entry.second->b, c.b);
      });
      const int kind = is_edge_on_edge(c) ? 1 : 0;
      for (int i = 0; i < 3; ++i)
        if (-c.gap > kDepths[i]) {
          ++of[kind][i];
          if (!like) ++(found_at_all ? other_way : missed)[kind][i];
        }
    }
    for (const auto& [pair, depth] : depths)
      for (int i = 0; i < 3; ++i)
        if (depth.first > kDepths[i]) {
          ++pairs[i];
          if (depth.second <= 0.0) ++unseen[i], worst_unseen = std::max(worst_unseen, depth.first);
        }
  }
};

void run(int bodies, int states, const std::vector<std::shared_ptr<const ModalModel>>& models) {
  std::printf("| body | vertices | modes | cell mm | made in s | kB | |\n|---|---|---|---|---|---|---|\n");
  Heap heap(models, bodies);
  heap.settle(30);
  Misses misses;
  double fields = 0.0, exact = 0.0, contacts = 0.0, exact_contacts = 0.0, touching = 0.0, pairs = 0.0;
  heap.deformed = 0.0;
  for (int s = 0; s < states; ++s) {
    heap.settle(4), heap.bend();
    heap.find_by_fields();
    heap.deformed = s == 0 ? 0.0 : heap.deformed;
    fields += heap.find_by_fields() / states, exact += heap.find_exactly() / states;
    contacts += static_cast<double>(heap.by_fields.size()) / states;
    exact_contacts += static_cast<double>(heap.exact.size()) / states;
    touching += static_cast<double>(heap.touching) / states, pairs += static_cast<double>(heap.pairs.size()) / states;
    misses.compare(heap.exact, heap.by_fields);
  }
  std::printf("\n%d bodies, %d states: %.0f pairs of boxes, %.0f touch.\n\n", bodies, states, pairs, touching);
  std::printf("| | ms a query | contacts | µs a touching pair | µs a contact |\n|---|---|---|---|---|\n");
  const auto row = [&](const char* name, double seconds, double found) {
    std::printf("| %s | %.2f | %.0f | %.1f | %.2f |\n", name, 1e3 * seconds, found, 1e6 * seconds / touching,
                1e6 * seconds / found);
  };
  row("fields", fields, contacts), row("ContactFinder, all contacts", exact, exact_contacts);
  std::printf("\nRatio %.1f.\n\n| missed, deeper than | 0.2 mm | 1 mm | 3 mm |\n|---|---|---|---|\n", exact / fields);
  const auto part = [](const char* name, const int(&of)[3], const int(&not_found)[3]) {
    std::printf("| %s |", name);
    for (int i = 0; i < 3; ++i)
      std::printf(" %d of %d (%.1f %%) |", not_found[i], of[i], of[i] > 0 ? 100.0 * not_found[i] / of[i] : 0.0);
    std::printf("\n");
  };
  part("vertex–surface", misses.of[0], misses.missed[0]);
  part("the same, found with another way out", misses.of[0], misses.other_way[0]);
  part("edge–edge", misses.of[1], misses.missed[1]);
  part("the same, found with another way out", misses.of[1], misses.other_way[1]);
  part("pairs unseen", misses.pairs, misses.unseen);
  std::printf("\nDeepest pair unseen %.2f mm.\n", 1e3 * misses.worst_unseen);
}

}  // namespace
}  // namespace limber::testing

int main(int argc, char** argv) {
  try {
    if (argc < 4) throw std::runtime_error("expected BODIES STATES ASSET.glb…");
    std::vector<std::shared_ptr<const limber::ModalModel>> models;
    for (int i = 3; i < argc; ++i) models.push_back(limber::read_asset(argv[i]).bodies.at(0));
    limber::testing::run(std::atoi(argv[1]), std::atoi(argv[2]), models);
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "field_contacts: %s\n", e.what());
    return 1;
  }
}
