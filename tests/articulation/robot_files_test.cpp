// URDF and MJCF as their own readers see them (urdfdom, MuJoCo), and the GLB's nodes.
#include "limber/articulation/robot_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>
#include <urdf_parser/urdf_parser.h>

#include <filesystem>
#include <map>
#include <numbers>

#include "constants.h"
#include "glb_view.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/mesh/read_mesh.h"
#include "sample_assembly.h"

namespace limber {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

using testing::kInfinity;

/// Both readers work in doubles, but rotations pass through products of a few of them.
constexpr double kRoundOff = 1e-9;
/// Meshes are float32.
constexpr double kFloat = 1e-5;

Component box_component(const std::string& name, const Vec3& low, const Vec3& high) {
  return testing::component_of(name, shapes::box(low, high));
}

DetectedJoint placed_joint(Index a, Index b, JointType type, const Vec3& origin, const Vec3& rotation) {
  DetectedJoint j;
  j.a = a, j.b = b;
  j.joint.type = type;
  j.joint.frame.origin = origin;
  j.joint.frame.axes = to_matrix(quaternion_from_rotation_vector(rotation));
  return j;
}

/// Parts in a row, a joint of every type between them, some of which the tree runs against.
struct Machine {
  Machine() {
    for (int i = 0; i < 8; ++i)
      assembly.components.push_back(
          box_component("part " + std::to_string(i), Vec3(2.0 * i, -1, 0), Vec3(2.0 * i + 1, 2, 3)));
    assembly.diagonal = 20.0;
    const auto add = [&](Index a, Index b, JointType type) -> JointSpec& {
      joints.push_back(
          placed_joint(a, b, type, {2.0 * std::min(a, b) + 1.5, 0.3, -0.2}, {0.4 * a + 0.1, 1.0 - 0.3 * b, 0.5}));
      return joints.back().joint;
    };
    add(0, 1, JointType::kRevolute).limits.rotation = {-0.5, 1.25};
    JointSpec& ball = add(2, 1, JointType::kBall);  // against the tree
    ball.limits.euler = {Interval{-1, 1}, Interval{-0.5, 0.75}, Interval{}};
    ball.limits.cone = 0.5;
    add(2, 3, JointType::kCylindrical).limits.translation[0] = {-1.5, kInfinity};
    add(4, 3, JointType::kPlanar).limits.translation[0] = {-2, 2};
    add(4, 5, JointType::kCylindrical).pitch = 0.25;
    add(6, 5, JointType::kPrismatic).limits.translation[0] = {-0.25, 3};
    add(6, 7, JointType::kFixed);
  }
  Assembly assembly;
  std::vector<DetectedJoint> joints;
};

/// Where part b goes as seen from a, in the frame of the input, for coordinates in the order of the table of JointSpec.
RigidTransform motion(const JointSpec& joint, const std::vector<double>& q, double unit) {
  const Vec3 origin = unit * joint.frame.origin;
  const auto turn = [&](int axis, double angle) {
    const Quaternion r = quaternion_from_rotation_vector(angle * joint.frame.axes.col(axis));
    return RigidTransform{r, origin - r * origin};
  };
  const auto slide = [&](int axis, double by) { return RigidTransform{{}, by * joint.frame.axes.col(axis)}; };
  switch (joint.type) {
    case JointType::kBall:
      return turn(0, q[0]) * turn(1, q[1]) * turn(2, q[2]);
    case JointType::kRevolute:
      return turn(0, q[0]);
    case JointType::kCylindrical:
      return turn(0, q[0]) * slide(0, q[1]);
    case JointType::kPrismatic:
      return slide(0, q[0]);
    case JointType::kPlanar:
      return slide(0, q[0]) * slide(1, q[1]) * turn(2, q[2]);
    case JointType::kFixed:
      break;
  }
  return {};
}

/// Suffixes of the coordinates' names in files, in the same order; empty for a joint of one freedom.
std::vector<std::string> suffixes(JointType type) {
  switch (type) {
    case JointType::kBall:
      return {"_rx", "_ry", "_rz"};
    case JointType::kCylindrical:
      return {"_rx", "_tx"};
    case JointType::kPlanar:
      return {"_tx", "_ty", "_rz"};
    case JointType::kFixed:
      return {};
    default:
      return {""};
  }
}

class RobotFiles : public ::testing::Test {
 protected:
  RobotFiles() {
    folder_ = fs::path(::testing::TempDir()) /
              ("limber_" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::create_directories(folder_ / "meshes");
  }
  ~RobotFiles() override { fs::remove_all(folder_); }

  fs::path write(const RobotFile& file, const std::string& name) const {
    write_file(folder_ / name, file.text);
    for (const auto& [mesh, bytes] : file.meshes) write_file(folder_ / "meshes" / mesh, bytes);
    return folder_ / name;
  }

  fs::path folder_;
};

struct MujocoModel {
  explicit MujocoModel(const fs::path& path) {
    char error[1000] = "";
    model = mj_loadXML(path.c_str(), nullptr, error, sizeof error);
    EXPECT_NE(model, nullptr) << error;
    if (model != nullptr) data = mj_makeData(model);
  }
  ~MujocoModel() {
    if (data != nullptr) mj_deleteData(data);
    if (model != nullptr) mj_deleteModel(model);
  }
  MujocoModel(const MujocoModel&) = delete;
  MujocoModel& operator=(const MujocoModel&) = delete;

  int joint(const std::string& name) const { return mj_name2id(model, mjOBJ_JOINT, name.c_str()); }
  int body(const std::string& name) const { return mj_name2id(model, mjOBJ_BODY, name.c_str()); }
  /// The motion of a body since the pose in which all coordinates are 0.
  RigidTransform moved(const std::string& name) const {
    const int b = body(name);
    const auto pose = [&] {
      return RigidTransform{
          {data->xquat[4 * b], data->xquat[4 * b + 1], data->xquat[4 * b + 2], data->xquat[4 * b + 3]},
          {data->xpos[3 * b], data->xpos[3 * b + 1], data->xpos[3 * b + 2]}};
    };
    const std::vector<double> q(data->qpos, data->qpos + model->nq);
    mj_kinematics(model, data);
    const RigidTransform now = pose();
    mju_copy(data->qpos, model->qpos0, model->nq);
    mj_kinematics(model, data);
    const RigidTransform then = pose();
    mju_copy(data->qpos, q.data(), model->nq);
    return now * then.inverse();
  }
  mjModel* model = nullptr;
  mjData* data = nullptr;
};

void expect_same(const RigidTransform& a, const RigidTransform& b, const std::string& what) {
  EXPECT_NEAR((to_matrix(a.q) - to_matrix(b.q)).norm(), 0.0, kRoundOff) << what;
  EXPECT_NEAR((a.p - b.p).norm(), 0.0, kRoundOff) << what;
}

const std::vector<std::string> kNames{"part_0__part_1", "part_1__part_2", "part_2__part_3", "part_3__part_4",
                                      "part_4__part_5", "part_5__part_6", "part_6__part_7"};

/// Coordinates that differ from each other and stay within the limits.
std::vector<double> coordinates(const JointSpec& joint, std::size_t number) {
  std::vector<double> q{0.3 + 0.05 * static_cast<double>(number), -0.4, 0.7};
  if (joint.pitch != 0.0) q[1] = joint.pitch * q[0];
  return q;
}

/// Poses of all parts by the joints' own definition.
std::vector<RigidTransform> expected_poses(const Machine& m, double unit) {
  std::vector<RigidTransform> X(m.assembly.components.size());
  for (std::size_t j = 0; j < m.joints.size(); ++j) {
    const RigidTransform step = motion(m.joints[j].joint, coordinates(m.joints[j].joint, j), unit);
    X[j + 1] = X[j] * (m.joints[j].a < m.joints[j].b ? step : step.inverse());
  }
  return X;
}

/// Moves every joint in MuJoCo and compares every part's pose with the joints' own definition.
void expect_mujoco_moves_as_defined(const MujocoModel& mj, const Machine& m, double unit) {
  ASSERT_NE(mj.model, nullptr);
  for (std::size_t j = 0; j < m.joints.size(); ++j) {
    const auto q = coordinates(m.joints[j].joint, j);
    const auto names = suffixes(m.joints[j].joint.type);
    for (std::size_t i = 0; i < names.size(); ++i) {
      const int joint = mj.joint(kNames[j] + names[i]);
      ASSERT_GE(joint, 0) << kNames[j] + names[i];
      mj.data->qpos[mj.model->jnt_qposadr[joint]] = q[i];
    }
  }
  const auto X = expected_poses(m, unit);
  for (std::size_t i = 1; i < X.size(); ++i)
    if (mj.body("part_" + std::to_string(i)) >= 0)  // a part fixed to another may be one body with it
      expect_same(mj.moved("part_" + std::to_string(i)), X[i], "part " + std::to_string(i));
}

TEST_F(RobotFiles, MujocoMovesTheMjcfAsTheJointsSay) {
  const Machine m;
  for (const double unit : {1.0, 0.001}) {
    const RobotFile file = mjcf_file(m.assembly, m.joints, {.name = "a \"robot\" & more", .metres_per_unit = unit});
    const MujocoModel mj(write(file, "m.xml"));
    expect_mujoco_moves_as_defined(mj, m, unit);
    EXPECT_NEAR(mj.model->jnt_range[2 * mj.joint("part_0__part_1") + 1], 1.25, kRoundOff);
    EXPECT_NEAR(mj.model->jnt_range[2 * mj.joint("part_1__part_2_ry")], -0.5, kRoundOff);
    EXPECT_FALSE(mj.model->jnt_limited[mj.joint("part_1__part_2_rz")]);
    EXPECT_NEAR(mj.model->jnt_range[2 * mj.joint("part_2__part_3_tx")], -1.5 * unit, kRoundOff);
    EXPECT_GT(mj.model->jnt_range[2 * mj.joint("part_2__part_3_tx") + 1], 1000 * 20 * unit * 0.99);
    EXPECT_NEAR(mj.model->jnt_range[2 * mj.joint("part_5__part_6") + 1], 3 * unit, kRoundOff);
    EXPECT_EQ(mj.model->neq, 1);  // the screw
    EXPECT_EQ(mj.model->nv, 1 + 3 + 2 + 3 + 2 + 1);
    // 1 × 3 × 3 boxes
    const int part = mj.body("part_2");
    const double mass = 1000.0 * 9.0 * unit * unit * unit;
    EXPECT_NEAR(mj.model->body_mass[part], mass, 1e-6 * mass);
    EXPECT_NEAR(mj.model->body_inertia[3 * part], mass / 12.0 * 18.0 * unit * unit, 1e-6 * mass * unit * unit);
    // The mesh is where the part is: its middle in the world.
    mj_resetData(mj.model, mj.data);
    mj_forward(mj.model, mj.data);
    const int geom = mj.model->body_geomadr[part];
    EXPECT_NEAR(mj.data->geom_xpos[3 * geom], 4.5 * unit, kFloat * unit);
    EXPECT_NEAR(mj.data->geom_xpos[3 * geom + 2], 1.5 * unit, kFloat * unit);
  }
  EXPECT_THAT(mjcf_file(m.assembly, m.joints).warnings, ::testing::ElementsAre(HasSubstr("cone of 28.6°")));
}

TEST_F(RobotFiles, MujocoMovesTheUrdfAsTheJointsSay) {
  const Machine m;
  const MujocoModel mj(write(urdf_file(m.assembly, m.joints), "m.urdf"));
  expect_mujoco_moves_as_defined(mj, m, 1.0);
}

RigidTransform pose_of(const urdf::Pose& p) {
  return {{p.rotation.w, p.rotation.x, p.rotation.y, p.rotation.z}, {p.position.x, p.position.y, p.position.z}};
}

TEST_F(RobotFiles, UrdfdomReadsAxesLimitsAndPlacesAsTheJointsHaveThem) {
  const Machine m;
  const RobotFile file = urdf_file(m.assembly, m.joints, {.name = "machine"});
  const auto robot = urdf::parseURDF(file.text);
  ASSERT_NE(robot, nullptr);
  EXPECT_EQ(robot->getName(), "machine");
  EXPECT_EQ(robot->getRoot()->name, "part_0");
  EXPECT_EQ(robot->links_.size(), 8u + 2 + 1 + 2 + 1);  // parts, and links between freedoms

  std::map<std::string, double> value;
  for (std::size_t j = 0; j < m.joints.size(); ++j) {
    const auto names = suffixes(m.joints[j].joint.type);
    for (std::size_t i = 0; i < names.size(); ++i) value[kNames[j] + names[i]] = coordinates(m.joints[j].joint, j)[i];
  }
  // Poses of links by the definition of URDF: origin of the joint, then motion about or along its axis.
  const std::function<RigidTransform(const std::string&, bool)> pose = [&](const std::string& name,
                                                                           bool moved) -> RigidTransform {
    const auto link = robot->getLink(name);
    if (!link->parent_joint) return {};
    const urdf::Joint& j = *link->parent_joint;
    const Vec3 axis{j.axis.x, j.axis.y, j.axis.z};
    const double q = moved && value.contains(j.name) ? value[j.name] : 0.0;
    const RigidTransform step = j.type == urdf::Joint::PRISMATIC
                                    ? RigidTransform{{}, q * axis}
                                    : RigidTransform{quaternion_from_rotation_vector(q * axis), Vec3::Zero()};
    return pose(j.parent_link_name, moved) * pose_of(j.parent_to_joint_origin_transform) * step;
  };
  const auto X = expected_poses(m, 1.0);
  for (std::size_t i = 1; i < X.size(); ++i) {
    const std::string name = "part_" + std::to_string(i);
    expect_same(pose(name, true) * pose(name, false).inverse(), X[i], name);
  }
  EXPECT_EQ(robot->getJoint("part_0__part_1")->type, urdf::Joint::REVOLUTE);
  EXPECT_NEAR(robot->getJoint("part_0__part_1")->limits->lower, -0.5, kRoundOff);
  EXPECT_EQ(robot->getJoint("part_1__part_2_rz")->type, urdf::Joint::CONTINUOUS);
  EXPECT_NEAR(robot->getJoint("part_1__part_2_ry")->limits->upper, 0.75, kRoundOff);
  EXPECT_EQ(robot->getJoint("part_5__part_6")->type, urdf::Joint::PRISMATIC);
  EXPECT_EQ(robot->getJoint("part_6__part_7")->type, urdf::Joint::FIXED);
  ASSERT_NE(robot->getJoint("part_4__part_5_tx")->mimic, nullptr);
  EXPECT_EQ(robot->getJoint("part_4__part_5_tx")->mimic->joint_name, "part_4__part_5_rx");
  EXPECT_NEAR(robot->getJoint("part_4__part_5_tx")->mimic->multiplier, 0.25, kRoundOff);
  const auto& inertial = *robot->getLink("part_3")->inertial;
  EXPECT_NEAR(inertial.mass, 9000.0, 1e-6);
  EXPECT_NEAR(inertial.iyy, 9000.0 / 12.0 * 10.0, 1e-6);
}

TEST_F(RobotFiles, ClosedChainsAreConstraintsInMjcfAndRemarksInUrdf) {
  // Four bars with pins along z.
  Assembly assembly;
  const Vec3 corners[] = {{0, 0, 0}, {4, 0, 0}, {4, 3, 0}, {0, 3, 0}};
  for (int i = 0; i < 4; ++i) {
    const Vec3 &p = corners[i], &q = corners[(i + 1) % 4];
    assembly.components.push_back(
        box_component("bar", p.cwiseMin(q) - Vec3::Constant(0.2), p.cwiseMax(q) + Vec3::Constant(0.2)));
  }
  std::vector<DetectedJoint> joints;
  for (Index i = 0; i < 4; ++i) {
    DetectedJoint j = placed_joint(std::min(i, (i + 3) % 4), std::max(i, (i + 3) % 4), JointType::kRevolute, corners[i],
                                   Vec3::Zero());
    j.joint.frame.axes << Vec3::UnitZ(), Vec3::UnitX(), Vec3::UnitY();
    joints.push_back(j);
  }
  const RobotFile mjcf = mjcf_file(assembly, joints);
  const MujocoModel mj(write(mjcf, "loop.xml"));
  ASSERT_NE(mj.model, nullptr);
  EXPECT_EQ(mj.model->nv, 3);
  EXPECT_EQ(mj.model->neq, 2);  // two points of the last pin
  mj_forward(mj.model, mj.data);
  double worst = 0.0;
  for (int i = 0; i < mj.data->nefc; ++i) worst = std::max(worst, std::abs(mj.data->efc_pos[i]));
  EXPECT_LT(worst, kRoundOff);  // closed as read

  const RobotFile urdf = urdf_file(assembly, joints);
  EXPECT_NE(urdf::parseURDF(urdf.text), nullptr);
  EXPECT_THAT(urdf.warnings, ::testing::ElementsAre(HasSubstr("closes a chain")));
  EXPECT_THAT(urdf.text, HasSubstr("<!-- closed chain"));
}

/// A plate with a row of parts: two gears, a screw that the second one drives, a rack.
TEST_F(RobotFiles, CouplingsAreMimicsInUrdfAndEqualitiesInMjcf) {
  Assembly assembly;
  std::vector<DetectedJoint> joints;
  assembly.components.push_back(box_component("plate", {0, 0, 0}, {20, 3, 1}));
  const JointType types[] = {JointType::kRevolute, JointType::kRevolute, JointType::kCylindrical,
                             JointType::kPrismatic};
  for (Index i = 0; i < 4; ++i) {
    assembly.components.push_back(box_component("g" + std::to_string(i), Vec3(4.0 * i, 0, 1), Vec3(4.0 * i + 1, 1, 2)));
    joints.push_back(placed_joint(0, i + 1, types[i], {4.0 * i, 0.5, 1.5}, {0.3, 0.2 * i, 0.1}));
  }
  joints[2].joint.pitch = 0.5;
  constexpr double kUnit = 0.001;
  const std::vector<JointCoupling> couplings{
      {{0, true}, {1, true}, -1.5, true}, {{2, true}, {1, true}, 3.0, true}, {{3, false}, {0, true}, 0.25, true}};
  const RobotOptions options{.metres_per_unit = kUnit, .couplings = couplings};
  // Of each speed to the first gear's, rad and m.
  const std::map<std::string, double> expected{
      {"plate__g1", -1.5}, {"plate__g2_rx", -0.5}, {"plate__g2_tx", -0.5 * 0.5 * kUnit}, {"plate__g3", 4.0 * kUnit}};
  const RobotFile urdf = urdf_file(assembly, joints, options);
  EXPECT_THAT(urdf.warnings, ::testing::IsEmpty());
  const auto robot = urdf::parseURDF(urdf.text);
  ASSERT_NE(robot, nullptr);
  EXPECT_EQ(robot->getJoint("plate__g0")->mimic, nullptr);
  for (const auto& [name, ratio] : expected) {
    ASSERT_NE(robot->getJoint(name)->mimic, nullptr) << name;
    EXPECT_EQ(robot->getJoint(name)->mimic->joint_name, "plate__g0");
    EXPECT_NEAR(robot->getJoint(name)->mimic->multiplier, ratio, kRoundOff);
  }
  const MujocoModel mj(write(mjcf_file(assembly, joints, options), "gears.xml"));
  ASSERT_NE(mj.model, nullptr);
  ASSERT_EQ(mj.model->neq, 4);
  // Where the coordinates follow the first gear's, the equalities are met; elsewhere not.
  mj.data->qpos[mj.model->jnt_qposadr[mj.joint("plate__g0")]] = 0.7;
  for (const auto& [name, ratio] : expected) mj.data->qpos[mj.model->jnt_qposadr[mj.joint(name)]] = 0.7 * ratio;
  const auto worst = [&] {
    mj_forward(mj.model, mj.data);
    double most = 0.0;
    for (int i = 0; i < mj.data->ne; ++i) most = std::max(most, std::abs(mj.data->efc_pos[i]));
    return most;
  };
  EXPECT_LT(worst(), kRoundOff);
  EXPECT_EQ(mj.data->ne, 4);
  mj.data->qpos[mj.model->jnt_qposadr[mj.joint("plate__g0")]] = 0.6;
  EXPECT_NEAR(worst(), 0.15, kRoundOff);
}

TEST_F(RobotFiles, CouplingsThatNoFormatSaysAreTold) {
  const Machine m;
  const JointCoupling uneven{{0, true}, {2, true}, 0.3, false}, missing{{0, true}, {1, true}, 2.0, true};
  EXPECT_THAT(urdf_file(m.assembly, m.joints, {.couplings = {uneven}}).warnings,
              ::testing::Contains(HasSubstr("its ratio changes on the way")));
  EXPECT_THROW(mjcf_file(m.assembly, m.joints, {.couplings = {missing}}), InvalidArgument);  // a ball
}

TEST_F(RobotFiles, LonePartsAndSheetsAreReadToo) {
  Assembly assembly;
  assembly.components = {box_component("a<b", {0, 0, 0}, {1, 1, 1}), box_component("a>b", {2, 0, 0}, {3, 1, 1})};
  Component sheet = box_component("", {4, 0, 0}, {5, 1, 1});
  sheet.surface.triangles.resize(10);
  sheet.closed = false;
  assembly.components.push_back(sheet);
  const RobotFile urdf = urdf_file(assembly, {});
  const auto robot = urdf::parseURDF(urdf.text);
  ASSERT_NE(robot, nullptr);
  EXPECT_EQ(robot->getRoot()->name, "world");
  EXPECT_EQ(robot->links_.size(), 4u);
  EXPECT_THAT(urdf.warnings, ::testing::ElementsAre(HasSubstr("bounds no solid")));
  EXPECT_NE(MujocoModel(write(mjcf_file(assembly, {}), "lone.xml")).model, nullptr);
  EXPECT_NE(MujocoModel(write(urdf, "lone.urdf")).model, nullptr);
}

TEST_F(RobotFiles, MeshesAreThePartsThemselves) {
  const Machine m;
  const RobotFile file = urdf_file(m.assembly, m.joints, {.metres_per_unit = 0.5});
  write(file, "m.urdf");
  Warnings warnings;
  const SurfaceMesh part = read_surface_mesh(folder_ / "meshes" / "part_3.stl", warnings);
  EXPECT_EQ(part.triangles.size(), 12u);
  EXPECT_NEAR(solid_properties(part).volume, 9.0 / 8.0, kFloat);
}

TEST_F(RobotFiles, WrongArgumentsAreTold) {
  const Machine m;
  EXPECT_THROW(urdf_file(m.assembly, m.joints, {.density = 0.0}), InvalidArgument);
  EXPECT_THROW(mjcf_file(m.assembly, m.joints, {.metres_per_unit = -1.0}), InvalidArgument);
  EXPECT_THROW(mjcf_file({}, {}), InvalidArgument);
  EXPECT_THROW(urdf_file(m.assembly, {placed_joint(0, 9, JointType::kBall, Vec3::Zero(), Vec3::Zero())}),
               InvalidArgument);
}

TEST(AssemblyGlb, PartsAreNodesAndAxesArePointers) {
  const Machine m;
  const testing::GlbView glb(assembly_glb(m.assembly, m.joints, 0.001));
  const auto& nodes = glb.json.at("nodes");
  EXPECT_EQ(nodes.size(), 8u + 3 + 1 + 1 + 1 + 1 + 1);  // three axes for the ball, none for the fixed joint
  EXPECT_EQ(nodes.at(2).at("name"), "part 2");
  EXPECT_NEAR(nodes.at(2).at("translation").at(0).get<double>(), 0.0045, 1e-9);
  for (const auto& node : nodes) {
    if (!node.at("name").get<std::string>().starts_with("revolute")) continue;
    const auto q = node.at("rotation").get<std::vector<double>>();  // x y z w
    const Vec3 x = Quaternion{q[3], q[0], q[1], q[2]} * Vec3::UnitX();
    EXPECT_NEAR((x - m.joints[0].joint.frame.axes.col(0)).norm(), 0.0, kFloat);
    EXPECT_NEAR(node.at("translation").at(0).get<double>(), 0.0015, 1e-9);
  }
  const testing::GlbView arrow(assembly_glb(m.assembly, m.joints));
  EXPECT_EQ(arrow.json.at("meshes").size(), 8u + 5);
}

TEST(SolidProperties, OfABoxAndABallAreThoseOfTheBooks) {
  const SolidProperties box = solid_properties(shapes::box({1, 2, 3}, {2, 4, 6}));
  EXPECT_NEAR(box.volume, 6.0, 1e-12);
  EXPECT_NEAR((box.centroid - Vec3(1.5, 3, 4.5)).norm(), 0.0, 1e-12);
  EXPECT_NEAR((box.inertia - Mat3(Vec3(6.0 / 12 * 13, 6.0 / 12 * 10, 6.0 / 12 * 5).asDiagonal())).norm(), 0.0, 1e-10);
  const SurfaceMesh sphere = shapes::sphere({5, 0, 0}, 2.0, 5);
  const SolidProperties ball = solid_properties(sphere);
  EXPECT_NEAR(ball.volume, enclosed_volume(sphere), 1e-9);
  const double faceted = 5e-3;  // 8192 triangles
  EXPECT_NEAR(ball.inertia(0, 0) / ball.volume, 0.4 * 4.0, 0.4 * 4.0 * faceted);
}

}  // namespace
}  // namespace limber
