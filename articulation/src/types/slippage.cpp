#include "limber/articulation/slippage.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "limber/core/cross_matrix.h"
#include "limber/core/error.h"
#include "number_text.h"
#include "tuning.h"
#include "types/joint_frame.h"
#include "types/motion_space.h"
#include "types/other_hypotheses.h"

namespace limber {
namespace {

using internal::Motion;
using internal::Motions;
using internal::MotionSpace;
using internal::rotation_about;
using internal::translation_along;
using internal::tuning;
using internal::TypesTuning;
using internal::WeightedPoint;

/// One family of motions fitted to a contact, in the contact's own coordinates.
struct Family {
  JointType type = JointType::kFixed;
  Vec3 axis = Vec3::UnitX();
  Vec3 origin = Vec3::Zero();
  double pitch = 0.0;
  Motions motions = Motions(6, 0);  ///< that the type leaves
};

Vec3 smallest_direction(const Mat3& symmetric) {
  return Eigen::SelfAdjointEigenSolver<Mat3>(symmetric).eigenvectors().col(0);
}

// Fits. Each minimises the normal velocities of its family's motions over the samples.

/// The point that all normals pass by nearest: Σ w (1 − n nᵀ)(p − q) = 0.
Family fit_ball(const MotionSpace& space) {
  Mat3 A = Mat3::Zero();
  Vec3 b = Vec3::Zero();
  for (const WeightedPoint& p : space.points()) {
    const Mat3 across = p.weight * (Mat3::Identity() - p.normal * p.normal.transpose());
    A += across;
    b += across * p.point;
  }
  Family out;
  out.type = JointType::kBall;
  out.origin = A.ldlt().solve(b);
  out.motions.resize(6, 3);
  for (int k = 0; k < 3; ++k) out.motions.col(k) = rotation_about(Vec3::Unit(k), out.origin);
  return out;
}

Family fit_planar(const MotionSpace& space) {
  Family out;
  out.type = JointType::kPlanar;
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(space.normal_covariance());
  out.axis = solver.eigenvectors().col(2);
  out.motions.resize(6, 3);
  out.motions << translation_along(solver.eigenvectors().col(0)), translation_along(solver.eigenvectors().col(1)),
      rotation_about(out.axis, Vec3::Zero());
  return out;
}

Family fit_prismatic(const MotionSpace& space) {
  Family out;
  out.type = JointType::kPrismatic;
  out.axis = smallest_direction(space.normal_covariance());
  out.motions = translation_along(out.axis);
  return out;
}

/// The point of the plane through 0 across `axis` about which a rotation has the least normal velocities; where the
/// contact does not tell (a plane turned about its normal), the one nearest to 0.
Vec3 best_centre(const MotionSpace& space, const Vec3& axis) {
  Eigen::Matrix<double, 3, 2> U;
  U.col(0) = axis.unitOrthogonal();
  U.col(1) = axis.cross(U.col(0));
  Eigen::Matrix<double, 6, 2> K;
  K << Eigen::Matrix<double, 3, 2>::Zero(), -cross_matrix(axis) * U;
  const Eigen::Matrix2d A = K.transpose() * space.C() * K;
  const Eigen::Vector2d b = -K.transpose() * space.C() * rotation_about(axis, Vec3::Zero());
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(A);
  Eigen::Vector2d x = Eigen::Vector2d::Zero();
  constexpr double kUndetermined = 1e-9;  // round-off of the largest possible entry, 1, with room
  for (int k = 0; k < 2; ++k)
    if (solver.eigenvalues()[k] > kUndetermined)
      x += solver.eigenvectors().col(k) * (solver.eigenvectors().col(k).dot(b) / solver.eigenvalues()[k]);
  return U * x;
}

Family rotation_family(const Vec3& axis, const Vec3& origin) {
  Family out;
  out.type = JointType::kRevolute;
  out.axis = axis;
  out.origin = origin;
  out.motions = rotation_about(axis, origin);
  return out;
}

/// Improves direction and place of an axis in turn.
Family refined_rotation(const MotionSpace& space, Vec3 axis) {
  Vec3 origin = best_centre(space, axis);
  constexpr double kSettled = 1e-12;  // rad: round-off
  for (std::size_t round = 0; round < tuning().types.fits.axis_rounds; ++round) {
    Motions about(6, 3);
    for (int k = 0; k < 3; ++k) about.col(k) = rotation_about(Vec3::Unit(k), origin);
    const Vec3 turned = about.topRows<3>() * space.spectrum(about).vectors.col(0);
    if (turned.norm() == 0.0) break;
    const double moved = turned.normalized().cross(axis).norm();
    axis = turned.normalized();
    origin = best_centre(space, axis);
    if (moved < kSettled) break;
  }
  return rotation_family(axis, origin);
}

Family fit_revolute(const MotionSpace& space) {
  std::vector<Vec3> starts;
  const auto lowest = space.spectrum().vectors;
  for (int k = 0; k < 3; ++k)
    if (lowest.col(k).head<3>().norm() > tuning().types.fits.least_turn * lowest.col(k).norm())
      starts.push_back(lowest.col(k).head<3>().normalized());
  const Eigen::SelfAdjointEigenSolver<Mat3> normals(space.normal_covariance());
  for (int k = 0; k < 3; ++k) starts.push_back(normals.eigenvectors().col(k));
  std::optional<Family> best;
  double best_mu = 0.0;
  for (const Vec3& start : starts) {
    const Family family = refined_rotation(space, start);
    const double mu = space.spectrum(family.motions).mu[0];
    if (!best || mu < best_mu) best = family, best_mu = mu;
  }
  return *best;
}

Family fit_cylindrical(const MotionSpace& space) {
  const Vec3 axis = smallest_direction(space.normal_covariance());
  Family out = rotation_family(axis, best_centre(space, axis));
  out.type = JointType::kCylindrical;
  out.motions.resize(6, 2);
  out.motions << rotation_about(out.axis, out.origin), translation_along(out.axis);
  return out;
}

/// The advance per radian about an axis that leaves the facets the least normal velocity. Normals that are interpolated
/// between corners would not do: on a flank, which is wider outside than inside, a point lies further along than its
/// share of the corners says, by 1/12 of the flank's height per radius and segment. That is nothing beside a segment,
/// but 5 % of the pitch of a bolt with 32 of them, and all triangles are cut the same way. The facets' own normals are
/// off to both sides alike.
double pitch_of_facets(const MotionSpace& space, const Vec3& axis, const Vec3& origin, double otherwise) {
  double turning = 0.0, advancing = 0.0;
  for (const WeightedPoint& p : space.points()) {
    const double along = p.facet_normal.dot(axis);
    turning += p.weight * along * p.facet_normal.dot(axis.cross(p.facet_point - origin));
    advancing += p.weight * along * along;
  }
  return advancing > 0.0 ? -turning / advancing : otherwise;
}

/// The pitch with which a contact of more than a turn comes to lie on itself after one: a turn brings every facet of a
/// thread drawn in whole segments onto another, so that how the facets are cut does not matter. Found by Newton's
/// method from a pitch that is off by much less than the thread's teeth are wide.
double pitch_over_a_turn(const MotionSpace& space, const Vec3& axis, double pitch) {
  const TypesTuning& t = tuning().types;
  const std::vector<WeightedPoint>& points = space.points();
  const std::size_t stride = 1 + points.size() / t.fits.pitch_compared;
  double found = pitch;
  for (std::size_t round = 0; round < t.fits.pitch_rounds; ++round) {
    const double turn = 2.0 * std::numbers::pi * found, limit = std::pow(t.fits.pitch_nearest * turn, 2);
    double residual = 0.0, slope = 0.0;
    std::size_t count = 0;
    for (std::size_t i = 0; i < points.size(); i += stride) {
      const Vec3 moved = points[i].facet_point + turn * axis;
      const WeightedPoint* nearest = nullptr;
      double least = limit;
      for (const WeightedPoint& q : points)
        if (const double squared = (q.facet_point - moved).squaredNorm();
            squared < least && q.facet_normal.dot(points[i].facet_normal) > t.fits.pitch_alike)
          nearest = &q, least = squared;
      if (nearest == nullptr) continue;
      const double along = 2.0 * std::numbers::pi * nearest->facet_normal.dot(axis);
      residual += points[i].weight * along * nearest->facet_normal.dot(moved - nearest->facet_point);
      slope += points[i].weight * along * along;
      ++count;
    }
    if (count < t.fits.pitch_fewest || !(slope > 0.0)) return pitch;
    found -= residual / slope;
    if (!(std::abs(found / pitch - 1.0) < t.fits.pitch_change)) return pitch;
  }
  return found;
}

/// The motion that slips best of all, if it turns: ω·v/ω² is its pitch, ω × v/ω² a point of its axis.
std::optional<Family> fit_screw(const MotionSpace& space) {
  const Motion xi = space.spectrum().vectors.col(0);
  const Vec3 omega = xi.head<3>(), v = xi.tail<3>();
  if (omega.norm() <= tuning().types.fits.screw_least_turn * xi.norm()) return std::nullopt;
  Family out = rotation_family(omega.normalized(), omega.cross(v) / omega.squaredNorm());
  out.type = JointType::kCylindrical;
  out.pitch = pitch_of_facets(space, out.axis, out.origin, omega.dot(v) / omega.squaredNorm());
  out.pitch = pitch_over_a_turn(space, out.axis, out.pitch);
  out.motions = xi / omega.norm();
  return out;
}

// Evidence.

/// How likely a motion slips. The tails keep one measurement from deciding alone.
double slip_probability(double mu, double threshold) {
  const double p = 1.0 / (1.0 + (mu / threshold) * (mu / threshold));
  return std::clamp(p, tuning().types.judging.tail, 1.0 - tuning().types.judging.tail);
}

struct Judged {
  Family family;
  double slippage = 0.0;  ///< largest μ of the family's motions
  double blocked = 1.0;   ///< smallest μ of the other motions
  double log_evidence = 0.0;
};

/// All the family's motions slip and no other does: the product of those probabilities.
Judged judge(const MotionSpace& space, const Family& family, double threshold) {
  Judged out;
  out.family = family;
  if (family.motions.cols() > 0) {
    const auto free = space.spectrum(family.motions).mu;
    for (const double mu : free) out.log_evidence += std::log(slip_probability(mu, threshold));
    out.slippage = free[free.size() - 1];
  }
  const auto held = space.spectrum(space.complement(family.motions)).mu;
  for (const double mu : held) out.log_evidence += std::log(1.0 - slip_probability(mu, threshold));
  out.blocked = held[0];
  return out;
}

/// The screw that slips, if plain motions do not. Plain ones are common and screws are not; one must beat them by far.
/// @param plain μ of the best rotation or translation
std::optional<Judged> judged_screw(const MotionSpace& space, double plain, double threshold) {
  const TypesTuning& t = tuning().types;
  if (plain <= t.judging.screw_least) return std::nullopt;
  const auto screw = fit_screw(space);
  if (!screw || screw->origin.norm() > t.judging.far_axis || std::abs(screw->pitch) > t.judging.far_axis)
    return std::nullopt;
  const Judged out = judge(space, *screw, threshold);
  return out.slippage < t.judging.screw_clearly * plain ? std::optional(out) : std::nullopt;
}

std::vector<Judged> judged_families(const MotionSpace& space, double threshold) {
  const TypesTuning& t = tuning().types;
  const Family revolute = fit_revolute(space);
  std::vector<Judged> all;
  for (const Family& family :
       {fit_ball(space), fit_planar(space), fit_cylindrical(space), revolute, fit_prismatic(space), Family{}})
    all.push_back(judge(space, family, threshold));
  const double rotation_mu = all[3].slippage, translation_mu = all[4].slippage;
  if (all[0].family.origin.norm() > t.judging.far_centre) all[0].log_evidence -= t.judging.ruled_out;
  if (revolute.origin.norm() > t.judging.far_axis) all[3].log_evidence -= t.judging.ruled_out;
  if (const auto screw = judged_screw(space, std::min(rotation_mu, translation_mu), threshold)) {
    all[3].log_evidence -= t.judging.screw_over_plain;
    all.push_back(*screw);
  }
  return all;
}

// Words.

/// As many digits as slippages are good for.
std::string slippage_text(double value) { return internal::number_text(value, 2); }

std::string reason(const Judged& judged, double threshold) {
  const JointFreedoms free = freedoms(judged.family.type);
  std::string text;
  if (judged.family.type == JointType::kFixed)
    text = "no motion slips";
  else if (judged.family.pitch != 0.0)
    text = "a turn with an advance slips: slippage " + slippage_text(judged.slippage);
  else {
    if (free.rotations > 0) text += std::to_string(free.rotations) + (free.rotations > 1 ? " rotations" : " rotation");
    if (free.rotations > 0 && free.translations > 0) text += " and ";
    if (free.translations > 0)
      text += std::to_string(free.translations) + (free.translations > 1 ? " translations" : " translation");
    text += " slip: slippage at most " + slippage_text(judged.slippage);
  }
  if (judged.family.motions.cols() < 6) text += ", every other motion at least " + slippage_text(judged.blocked);
  return text + " (threshold " + slippage_text(threshold) + ")";
}

JointHypothesis in_words(const MotionSpace& space, const Judged& judged, double threshold) {
  JointHypothesis out;
  out.joint.type = judged.family.type;
  out.joint.pitch = judged.family.pitch * space.scale();
  out.joint.frame = internal::joint_frame(judged.family.type, judged.family.axis, space.to_input(judged.family.origin),
                                          space.middles());
  out.slippage = judged.slippage;
  out.reason = reason(judged, threshold);
  return out;
}

/// [X09] 3.2: how many eigenvalues of C about the centroid are below the largest by the ratio g, and how many of their
/// motions turn.
JointType type_by_ratio(const MotionSpace& space, double ratio, std::array<double, 6>& relative) {
  const auto [values, vectors] = space.spectrum_of_C();
  int slips = 0;
  const double largest = values[5];
  for (int j = 0; j < 6; ++j) {
    relative[static_cast<std::size_t>(j)] = std::max(0.0, values[j] / largest);
    if (values[j] * ratio < largest) ++slips;
  }
  slips = std::min(slips, 3);
  if (slips == 0) return JointType::kFixed;
  // Squares of the singular values of the turns.
  const Mat3 turns = vectors.topLeftCorner(3, slips) * vectors.topLeftCorner(3, slips).transpose();
  const Vec3 squares = Eigen::SelfAdjointEigenSolver<Mat3>(turns, Eigen::EigenvaluesOnly).eigenvalues();
  const auto rotations = (squares.array() > std::pow(tuning().types.judging.ratio_turns, 2)).count();
  if (slips == 3) return rotations >= 2 ? JointType::kBall : JointType::kPlanar;
  if (slips == 2) return JointType::kCylindrical;
  return rotations > 0 ? JointType::kRevolute : JointType::kPrismatic;
}

/// All hypotheses of a contact as it stands.
Slippage hypotheses_of(const std::vector<ContactRegion>& regions, const SlippageOptions& options) {
  const MotionSpace space(regions);
  Slippage out;
  out.threshold = options.threshold + space.spread();
  auto judged = judged_families(space, out.threshold);
  if (options.method == SlippageMethod::kFixedRatio) {
    const JointType type = type_by_ratio(space, options.ratio, out.mu);
    for (Judged& j : judged)
      j.log_evidence = j.family.type == type && j.family.pitch == 0.0 ? 0.0 : -tuning().types.judging.ruled_out;
  } else {
    const auto mu = space.spectrum().mu;
    std::copy(mu.begin(), mu.end(), out.mu.begin());
  }
  std::stable_sort(judged.begin(), judged.end(),
                   [](const Judged& x, const Judged& y) { return x.log_evidence > y.log_evidence; });
  double sum = 0.0;
  for (const Judged& j : judged) sum += std::exp(j.log_evidence - judged.front().log_evidence);
  for (const Judged& j : judged) {
    out.hypotheses.push_back(in_words(space, j, out.threshold));
    out.hypotheses.back().confidence = std::exp(j.log_evidence - judged.front().log_evidence) / sum;
  }
  return out;
}

// Stops.

/// A surface direction as component a shows it, and the area of the sample.
struct Facing {
  Vec3 normal;
  double area;
};

std::vector<Facing> faces_of(const std::vector<ContactRegion>& regions) {
  std::size_t count = 0;
  for (const ContactRegion& r : regions) count += r.on_a.size() + r.on_b.size();
  const std::size_t stride = 1 + count / tuning().types.others.stop_compared;
  std::vector<Facing> out;
  std::size_t i = 0;
  for (const ContactRegion& r : regions)
    for (const auto& [side, sign] : {std::pair(&r.on_a, 1.0), {&r.on_b, -1.0}})
      for (const ContactSample& s : *side)
        if (i++ % stride == 0) out.push_back({sign * s.normal, s.area});
  return out;
}

/// The normal of the largest face that nothing looks against: it holds one way only.
std::optional<Vec3> one_sided_face(const std::vector<ContactRegion>& regions) {
  const TypesTuning& t = tuning().types;
  const auto faces = faces_of(regions);
  double all = 0.0, largest = 0.0;
  for (const Facing& f : faces) all += f.area;
  std::optional<Vec3> out;
  for (const Facing& f : faces) {
    double like = 0.0, against = 0.0;
    for (const Facing& other : faces) {
      const double cosine = f.normal.dot(other.normal);
      if (cosine > t.others.stop_alike) like += other.area;
      if (cosine < -t.others.stop_alike) against += other.area;
    }
    if (against <= t.others.stop_against * like && like > t.others.stop_least * all && like > largest)
      largest = like, out = f.normal;
  }
  return out;
}

std::vector<ContactRegion> without_face(std::vector<ContactRegion> regions, const Vec3& normal) {
  for (ContactRegion& r : regions)
    for (const auto& [side, sign] : {std::pair(&r.on_a, 1.0), {&r.on_b, -1.0}})
      std::erase_if(*side, [&, sign = sign](const ContactSample& s) {
        return sign * s.normal.dot(normal) > tuning().types.others.stop_alike;
      });
  return regions;
}

bool slides_along(const JointSpec& joint, const Vec3& direction) {
  return (joint.type == JointType::kPrismatic || (joint.type == JointType::kCylindrical && joint.pitch == 0.0)) &&
         std::abs(joint.frame.axes.col(0).dot(direction)) > tuning().types.others.stop_along;
}

/// A drawer at its stop touches what a peg in a blind hole touches, a piston at its dead centre what a pin with a head
/// does. What would slide but for one face that holds one way only stays among the hypotheses, with a share of the
/// first one's confidence. It does not overtake: nothing in the geometry tells the two apart.
void add_hypothesis_with_stop(const std::vector<ContactRegion>& regions, const SlippageOptions& options,
                              Slippage& out) {
  const TypesTuning& t = tuning().types;
  JointHypothesis& first = out.hypotheses.front();
  if (first.joint.type != JointType::kFixed && first.joint.type != JointType::kRevolute) return;
  const auto stop = one_sided_face(regions);
  if (!stop) return;
  const auto rest = without_face(regions, *stop);
  std::size_t left = 0;
  for (const ContactRegion& r : rest) left += r.on_a.size() + r.on_b.size();
  if (left < t.others.stop_fewest) return;
  JointHypothesis free = hypotheses_of(rest, options).hypotheses.front();
  if (!slides_along(free.joint, *stop)) return;
  free.confidence = internal::share_of_first(t.others.stop_share * free.confidence, out);
  free.reason = "the face that holds it one way only may be a stop; without it " + free.reason;
  internal::replace_hypothesis(std::move(free), out);
}

}  // namespace

void SlippageOptions::validate() const {
  if (!(threshold > 0.0 && threshold < 1.0))
    throw InvalidArgument("SlippageOptions: threshold is " + std::to_string(threshold) + ", expected between 0 and 1");
  if (!(ratio > 1.0))
    throw InvalidArgument("SlippageOptions: ratio is " + std::to_string(ratio) + ", expected more than 1");
}

Slippage analyse_slippage(const std::vector<ContactRegion>& regions, const SlippageOptions& options) {
  options.validate();
  std::size_t samples = 0;
  for (const ContactRegion& r : regions) samples += r.on_a.size() + r.on_b.size();
  if (samples == 0) throw InvalidArgument("analyse_slippage: the contact has no samples");
  Slippage out = hypotheses_of(regions, options);
  if (options.method == SlippageMethod::kFixedRatio) return out;
  add_hypothesis_with_stop(regions, options, out);
  internal::add_hypothesis_of_flange(regions, out);
  return out;
}

}  // namespace limber
