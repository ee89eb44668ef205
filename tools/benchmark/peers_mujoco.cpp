#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <variant>

#include "cpu_time.h"
#include "limber/core/error.h"
#include "peers.h"

namespace limber::tools {
namespace {

std::string geometry(const Shape& shape) {
  if (const auto* box = std::get_if<Box>(&shape))
    return fmt::format("type='box' size='{:.17g} {:.17g} {:.17g}'", box->half_extents.x(), box->half_extents.y(),
                       box->half_extents.z());
  if (const auto* ball = std::get_if<Sphere>(&shape)) return fmt::format("type='sphere' size='{:.17g}'", ball->radius);
  if (const auto* c = std::get_if<Capsule>(&shape))
    return fmt::format("type='capsule' size='{:.17g} {:.17g}'", c->radius, c->half_length);
  throw InvalidArgument("mujoco_pile: expected boxes, balls and capsules");
}

std::string document(const RigidPile& pile) {
  std::string xml = fmt::format(
      "<mujoco><option timestep='{:.17g}' gravity='{:.17g} {:.17g} {:.17g}' solver='Newton' cone='elliptic'/>"
      "<size njmax='12000' nconmax='3000' nstack='250000000'/><default><geom friction='{:.17g}'/></default><worldbody>",
      pile.step, pile.gravity.x(), pile.gravity.y(), pile.gravity.z(), pile.friction);
  for (const RigidPile::Plane& p : pile.planes)
    xml +=
        fmt::format("<geom type='plane' size='9 9 1' pos='{:.17g} {:.17g} {:.17g}' zaxis='{:.17g} {:.17g} {:.17g}'/>",
                    p.offset * p.normal.x(), p.offset * p.normal.y(), p.offset * p.normal.z(), p.normal.x(),
                    p.normal.y(), p.normal.z());
  for (const RigidPile::Body& b : pile.bodies)
    xml += fmt::format(
        "<body pos='{:.17g} {:.17g} {:.17g}' quat='{:.17g} {:.17g} {:.17g} {:.17g}'><freejoint/><inertial pos='0 0 0' "
        "mass='{:.17g}' diaginertia='{:.17g} {:.17g} {:.17g}'/><geom {}/></body>",
        b.pose.p.x(), b.pose.p.y(), b.pose.p.z(), b.pose.q.w, b.pose.q.x, b.pose.q.y, b.pose.q.z, b.mass, b.inertia.x(),
        b.inertia.y(), b.inertia.z(), geometry(*b.shape));
  return xml + "</worldbody></mujoco>";
}

class MujocoPile final : public PileEngine {
 public:
  explicit MujocoPile(const RigidPile& pile) {
    const std::string xml = document(pile);
    const auto files = std::make_unique<mjVFS>();
    mj_defaultVFS(files.get());
    mj_makeEmptyFileVFS(files.get(), "pile.xml", static_cast<int>(xml.size()));
    std::memcpy(files->filedata[mj_findFileVFS(files.get(), "pile.xml")], xml.data(), xml.size());
    std::array<char, 1000> error{};
    model_.reset(mj_loadXML("pile.xml", files.get(), error.data(), static_cast<int>(error.size())));
    mj_deleteVFS(files.get());
    if (!model_) throw ComputationError(std::string("MuJoCo refuses the pile: ") + error.data());
    data_.reset(mj_makeData(model_.get()));
  }

  PileStep step() override {
    const double began = thread_seconds();
    mj_step(model_.get(), data_.get());
    PileStep out{.seconds = thread_seconds() - began, .contacts = data_->ncon};
    for (int i = 0; i < data_->ncon; ++i) out.deepest = std::max(out.deepest, -data_->contact[i].dist);
    return out;
  }
  PileMotion motion(std::size_t body) const override {
    const mjtNum* p = data_->qpos + 7 * body;
    const mjtNum* v = data_->qvel + 6 * body;
    const Quaternion q{p[3], p[4], p[5], p[6]};
    return {.pose = {q, Vec3(p[0], p[1], p[2])},
            .velocity = Vec3(v[0], v[1], v[2]),
            .angular_velocity = q * Vec3(v[3], v[4], v[5])};  // of free joints: in the body's axes
  }

 private:
  struct Free {
    void operator()(mjModel* m) const { mj_deleteModel(m); }
    void operator()(mjData* d) const { mj_deleteData(d); }
  };
  std::unique_ptr<mjModel, Free> model_;
  std::unique_ptr<mjData, Free> data_;
};

}  // namespace

std::unique_ptr<PileEngine> mujoco_pile(const RigidPile& pile) { return std::make_unique<MujocoPile>(pile); }

}  // namespace limber::tools
