/// @file limber/scene/blows.h
/// What strikes the bodies of a scene while it is played, and what each makes of it.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "limber/core/types.h"
#include "limber/engine/world.h"
#include "limber/model/modal_model.h"
#include "limber/model/sound_modes.h"
#include "limber/scene/scene_file.h"
#include "limber/scene/scene_player.h"
#include "limber/sound/modal_sound.h"

namespace limber {

/// Between the roughnesses of a surface, along the way that a contact slides; m.
inline constexpr double kRoughness = 5e-4;
/// Roughnesses that pass faster than one can hear count as fewer and larger ones, 1/s: twice 20 kHz.
inline constexpr double kMostRoughnesses = 4e4;
/// Of the work of friction, what becomes vibration.
inline constexpr double kShareOfFriction = 1e-3;

/// Something that struck a body: a strike of the scene, a contact that began with an approach, or a roughness that a
/// contact slid over.
struct BlowRecord {
  static constexpr std::size_t kNobody = ~std::size_t{0};
  double time = 0.0;             ///< s: of the strike, or of the start of the step in which the contact began
  std::size_t body = 0;          ///< which was struck, of Trajectory::bodies
  std::size_t other = kNobody;   ///< which struck it, as ContactRecord numbers them; kNobody: not by a collision
  Vec3 position = Vec3::Zero();  ///< world, m
  Vec3 point = Vec3::Zero(), impulse = Vec3::Zero();  ///< the place and the impulse on the body, body frame, m and N·s
  double contact_time = 0.0;                          ///< of what is no collision, s
  /// Of a contact, of both bodies together as contact_time.h has them: m, kg, R, m, and v, m/s. A body without a radius
  /// of its own (ContactSide) counts as a ball of its volume, a static as flat.
  double mass = kUnbounded, radius = kUnbounded, approach = 0.0;
};

/// Appends the blows of the step that `player` took last.
/// @param bodies that move, in the order of their numbers; more than the scene's where others were added
/// @param number_of by BodyId::index the number of a body, of a static one bodies.size() or more
void list_blows(const Scene& scene, const ScenePlayer& player, std::span<const BodyId> bodies,
                std::span<const std::size_t> number_of, std::vector<BlowRecord>& blows);

/// Appends the noise of friction of the step that `player` took last: a contact that lasts and slides at speed v under
/// the friction f meets v/d roughnesses a second, of distance d = max(kRoughness, v/kMostRoughnesses). Each is a blow
/// on both bodies along f, of the duration d/v and the impulse J = √(2 m η f d) times a number of mean 0 and variance
/// 1, even between ±√3: it gives the mass m that the contact feels along f the share η = kShareOfFriction of the work f
/// d. So the power of the noise follows that of friction, f v, and its highest frequency v/d follows the speed [van den
/// Doel, Kry and Pai, FoleyAutomatic, 2001]. Numbers come from the contact and the step: the same whenever it is
/// played.
/// @param bodies, number_of as for list_blows(); of the scene's static i, bodies.size() + i
void list_slides(const Scene& scene, const ScenePlayer& player, std::span<const BodyId> bodies,
                 std::span<const std::size_t> number_of, std::vector<BlowRecord>& blows);

/// A kind of body as one hears it.
class SoundingBody {
 public:
  /// @param surface that is struck, whose vertices the modes are known at; outlives this
  /// @throws InvalidArgument as monopole_gains()
  SoundingBody(std::shared_ptr<const SoundModes> modes, const ModalSurface& surface);

  const SoundModes& modes() const { return *modes_; }
  const std::vector<double>& gains() const { return gains_; }  ///< monopole_gains()
  double radius() const { return radius_; }                    ///< of the ball of its surface's area, m
  StruckPoint nearest(const Vec3& point) const;                ///< of the surface at rest. @param point body frame, m
  /// Pa at one metre per N·s that no blow so long exceeds once it is over: Σ g |w| |F(ω)| over the modes at the vertex
  /// where that is most. F is the blow's transform, sin x/(x (1 − (x/π)²)) with x = ωτ/2.
  double largest_pressure(double contact_time) const;

 private:
  std::shared_ptr<const SoundModes> modes_;
  const ModalSurface* surface_;
  std::vector<double> gains_;
  double radius_ = 0.0;
};

/// How long a blow lasts, s: its own time, or that of Hertz's collision (limber/sound/contact_time.h) of the two
/// bodies. What is softer or harder than Blow::contact_time may say has the ends of its range.
/// @param body, other null: rigid
double duration_of(const BlowRecord& blow, const SoundingBody* body, const SoundingBody* other);

}  // namespace limber
