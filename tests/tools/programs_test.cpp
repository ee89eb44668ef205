// limber-simulate, limber-inspect and limber-benchmark as a user runs them: exit codes, one line per error, whole files
// or none.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "example_scene.h"
#include "glb_view.h"
#include "run_program.h"

namespace limber {
namespace {

namespace fs = std::filesystem;
using testing::GlbView;
using ::testing::HasSubstr;
using testing::ProgramResult;

class Programs : public ::testing::Test {
 protected:
  Programs() {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("limber_") + test->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    testing::write_example_scene(folder_);
  }
  ~Programs() override { fs::remove_all(folder_); }

  ProgramResult run(const std::string& name, const std::vector<std::string>& arguments,
                    std::optional<rlim_t> largest_file = {}) const {
    return testing::run_program(name, arguments, folder_, largest_file);
  }
  ProgramResult simulate(const std::vector<std::string>& more, std::optional<rlim_t> largest_file = {}) const {
    std::vector<std::string> all{"scene.json"};
    all.insert(all.end(), more.begin(), more.end());
    return run("limber-simulate", all, largest_file);
  }

  std::string bytes(const std::string& name) const { return read_file(folder_ / name); }
  nlohmann::json json(const std::string& name) const { return nlohmann::json::parse(bytes(name)); }
  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_)) names.insert(entry.path().filename().string());
    return names;
  }
  void replace_in_scene(const std::string& what, const std::string& by) const {
    std::string text = testing::kExampleScene;
    text.replace(text.find(what), what.size(), by);
    write_file(folder_ / "scene.json", text);
  }

  static void expect_one_line(const ProgramResult& r, int code, const std::string& holds) {
    EXPECT_EQ(r.exit_code, code) << r.err;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
    EXPECT_THAT(r.err, ::testing::StartsWith("limber-"));
    EXPECT_THAT(r.err, HasSubstr(holds));
  }

  fs::path folder_;
  const std::set<std::string> given_{"block.glb", "scene.json"};
};

TEST_F(Programs, SimulateWritesWhatItIsAskedFor) {
  const ProgramResult r = simulate({"--record", "out.glb", "--record-frame-rate", "250", "--energies", "e.csv",
                                    "--mode-energies", "m.csv", "--report", "r.json", "--reconstruct"});
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_TRUE(r.err.empty()) << r.err;
  EXPECT_THAT(r.out, HasSubstr("250 steps"));
  const auto report = json("r.json");
  EXPECT_EQ(report.at("program"), "limber-simulate");
  EXPECT_EQ(report.at("steps"), 250);
  EXPECT_EQ(report.at("substeps"), 1);
  EXPECT_EQ(report.at("asleep"), 0);
  EXPECT_EQ(report.at("bodies").size(), 5u);
  EXPECT_EQ(report.at("strikes").size(), 5u);
  EXPECT_EQ(report.at("strikes").at(0).at("step"), 16);
  EXPECT_NEAR(report.at("strikes").at(0).at("delay").get<double>(), 0.0013, 1e-12);
  EXPECT_EQ(report.at("recording").at("keys"), 126);
  EXPECT_GT(report.at("seconds").at("reconstruct_per_vertex").get<double>(), 0.0);
  EXPECT_EQ(GlbView(bytes("out.glb")).times().size(), 126u);
  const std::string energies = bytes("e.csv");
  EXPECT_EQ(std::count(energies.begin(), energies.end(), '\n'), 1 + 126 * 5);
}

TEST_F(Programs, EqualRunsGiveEqualBytesButForTheirSeconds) {
  for (const std::string i : {"1", "2"})
    ASSERT_EQ(simulate({"--record", "out" + i + ".glb", "--report", "r" + i + ".json", "--energies", "e" + i + ".csv"})
                  .exit_code,
              0);
  EXPECT_EQ(bytes("out1.glb"), bytes("out2.glb"));
  EXPECT_EQ(bytes("e1.csv"), bytes("e2.csv"));
  auto first = json("r1.json"), second = json("r2.json");
  for (auto* report : {&first, &second}) {
    report->erase("seconds");
    report->at("recording").erase("file");
  }
  EXPECT_EQ(first, second);
}

TEST_F(Programs, StepsOnTheCommandLineWinOverTheScene) {
  ASSERT_EQ(simulate({"--steps", "10", "--report", "r.json"}).exit_code, 0);
  const auto report = json("r.json");
  EXPECT_EQ(report.at("steps"), 10);
  EXPECT_TRUE(report.at("strikes").empty());  // the first strike is in step 16
}

TEST_F(Programs, SlowMotionKeepsMoreKeysAndShowsThemLater) {
  ASSERT_EQ(simulate({"--record", "out.glb", "--record-frame-rate", "25", "--slow-motion", "4"}).exit_code, 0);
  const auto times = GlbView(bytes("out.glb")).times();
  EXPECT_EQ(times.size(), 51u);
  EXPECT_FLOAT_EQ(times.back(), 2.0f);
}

TEST_F(Programs, UnsignedWeightsStayInTheirRange) {
  ASSERT_EQ(simulate({"--record", "out.glb", "--unsigned-weights"}).exit_code, 0);
  const auto weights = GlbView(bytes("out.glb")).channel("one", "weights");
  EXPECT_GE(*std::min_element(weights.begin(), weights.end()), 0.0f);
  EXPECT_LE(*std::max_element(weights.begin(), weights.end()), 1.0f);
}

TEST_F(Programs, AManifestTellsWhatTheSceneDidNotNeed) {
  replace_in_scene("\"step\": 0.002,", "\"step\": 0.002, \"limits\": {\"frame_rate\": 60},");
  const ProgramResult r = simulate({"--report", "r.json"});
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const auto report = json("r.json");
  const auto& model = report.at("models").at(0);
  EXPECT_EQ(model.at("modes_in_asset"), 4);
  EXPECT_EQ(model.at("modes"), 2);
  EXPECT_EQ(model.at("dropped").at(1).at("reason"), "above_half_frame_rate");
  EXPECT_THAT(r.out, HasSubstr("2 modes of 4"));
}

TEST_F(Programs, SimulateTellsWhatTouchedHungAndWasHeld) {
  write_file(folder_ / "scene.json", R"({
    "step": 0.01, "duration": 0.5, "assets": {"block": "block.glb"},
    "statics": [{"name": "ground", "shape": {"half_space": {}}, "friction": 0.2}],
    "bodies": [{"name": "falls", "asset": "block", "position": [0, 0, 0.6], "friction": 0.2},
               {"name": "hangs", "asset": "block", "position": [4, 0, 4]},
               {"name": "held", "asset": "block", "position": [8, 0, 4]}],
    "joints": [{"b": "hangs", "type": "ball", "origin": [3, 0, 4]}],
    "handles": [{"body": "held", "at": {"nearest": [8, 0.5, 4.5]}}]})");
  const ProgramResult r = simulate({"--contacts", "c.csv", "--report", "r.json", "--record", "out.glb"});
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.out, HasSubstr("joint   the world to hangs"));
  EXPECT_THAT(r.out, HasSubstr("handle  held"));
  const auto report = json("r.json");
  EXPECT_EQ(report.at("contact").at("method"), "complementary");
  EXPECT_EQ(report.at("contact").at("friction_model"), "cone");
  EXPECT_GT(report.at("constraints").at("contacts_begun"), 0);
  EXPECT_EQ(report.at("constraints").at("limit_steps"), 0);
  EXPECT_EQ(report.at("constraints").at("failed_steps"), 0);
  EXPECT_EQ(report.at("joints").at(0).at("position").size(), 3u);
  EXPECT_TRUE(report.at("joints").at(0).at("a").is_null());
  EXPECT_LT(report.at("joints").at(0).at("largest_distance_error"), 1e-9);
  EXPECT_LT(report.at("handles").at(0).at("largest_error"), 1.8e-9);  // three rows, each closed to 1e-9
  const std::string contacts = bytes("c.csv");
  EXPECT_THAT(contacts, HasSubstr(",begun,falls,ground,"));
  EXPECT_THAT(contacts, HasSubstr(",lasting,falls,ground,"));
  EXPECT_EQ(contacts.find("hangs"), std::string::npos);
}

TEST_F(Programs, WrongUsageIsExitCodeTwoInOneLine) {
  expect_one_line(run("limber-simulate", {}), 2, "SCENE.json");
  expect_one_line(simulate({"--stesp", "3"}), 2, "did you mean \"--steps\"");
  expect_one_line(simulate({"--steps", "-1"}), 2, "--steps");
  expect_one_line(simulate({"--record-frame-rate", "nan"}), 2, "--record-frame-rate");
  expect_one_line(simulate({"--slow-motion", "0"}), 2, "--slow-motion");
  expect_one_line(simulate({"--record", "same", "--report", "same"}), 2, "two outputs");
  expect_one_line(simulate({"--report", "scene.json"}), 2, "is an input too");
  expect_one_line(simulate({"--record", "block.glb"}), 2, "is an input too");
  expect_one_line(run("limber-inspect", {}), 2, "ASSET.glb");
  expect_one_line(run("limber-inspect", {"block.glb", "--frequencies", "block.glb"}), 2, "is an input too");
  EXPECT_EQ(files(), given_);
}

TEST_F(Programs, WrongFilesAreExitCodeOneInOneLineAndNothingIsWritten) {
  const std::vector<std::string> outputs{"--record", "out.glb", "--report", "r.json", "--energies", "e.csv"};
  const auto with = [&](const std::string& scene) {
    std::vector<std::string> all{scene};
    all.insert(all.end(), outputs.begin(), outputs.end());
    return run("limber-simulate", all);
  };
  expect_one_line(with("missing.json"), 1, "missing.json");
  expect_one_line(with("."), 1, "is a directory");
  expect_one_line(with("block.glb"), 1, "not valid JSON");
  replace_in_scene("block.glb", "missing.glb");
  expect_one_line(with("scene.json"), 1, "missing.glb");
  replace_in_scene("block.glb", "scene.json");
  expect_one_line(with("scene.json"), 1, "scene.json");
  replace_in_scene("\"gravity\"", "\"gravty\"");
  expect_one_line(with("scene.json"), 1, "did you mean \"gravity\"");
  replace_in_scene("\"gravity\"",
                   "\"statics\": [{\"name\": \"g\", \"shape\": {\"mesh\": {\"file\": \"none.obj\"}}}], \"gravity\"");
  expect_one_line(with("scene.json"), 1, "none.obj");
  replace_in_scene("\"vertex\": 3", "\"vertex\": 3000");
  expect_one_line(with("scene.json"), 1, "strikes[1].at.vertex");
  expect_one_line(run("limber-inspect", {"scene.json", "--report", "r.json"}), 1, "scene.json");
  EXPECT_EQ(files(), given_);
}

TEST_F(Programs, MotionBeyondTheNumbersIsOneLineAndNothingIsWritten) {
  replace_in_scene("\"gravity\": [0, 0, -1]", "\"gravity\": [0, 0, 1e300]");
  expect_one_line(simulate({"--report", "r.json", "--energies", "e.csv"}), 1, "energy is not finite");
  EXPECT_EQ(files(), given_);
}

TEST_F(Programs, AnUnreadableFileIsToldByName) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may read everything";
  ::chmod((folder_ / "scene.json").c_str(), 0);
  expect_one_line(simulate({}), 1, "Permission denied");
}

TEST_F(Programs, OutputsThatCannotBeWrittenLeaveNothingBehind) {
  expect_one_line(simulate({"--record", "missing/out.glb", "--report", "r.json"}), 1, "missing/out.glb");
  expect_one_line(simulate({"--record", ".", "--report", "r.json"}), 1, "is a directory");
  EXPECT_EQ(files(), given_);
}

TEST_F(Programs, ADiskThatFillsLeavesNothingBehind) {
  write_file(folder_ / "r.json", "what was there before");
  expect_one_line(simulate({"--report", "r.json", "--record", "out.glb"}, rlim_t{4096}), 1, "out.glb");
  EXPECT_EQ(bytes("r.json"), "what was there before");
  fs::remove(folder_ / "r.json");
  EXPECT_EQ(files(), given_);
}

TEST_F(Programs, InspectTellsFrequenciesMassAndSizes) {
  const ProgramResult r = run("limber-inspect", {"block.glb", "--report", "r.json", "--frequencies", "f.csv"});
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.out, HasSubstr("3 kg"));
  EXPECT_THAT(r.out, HasSubstr("2 x 1 x 1 m"));
  const auto report = json("r.json");
  const auto& body = report.at("bodies").at(0);
  EXPECT_EQ(body.at("mass"), 3.0);
  EXPECT_EQ(body.at("motion"), "free");
  EXPECT_EQ(body.at("modes").size(), 4u);
  for (std::size_t m = 0; m < 4; ++m) {
    const auto& mode = body.at("modes").at(m);
    const double f = testing::block_frequency_hz(static_cast<Index>(m)),
                 decay = testing::block_decay(static_cast<Index>(m));
    const double omega = 2.0 * std::numbers::pi * f;
    EXPECT_NEAR(mode.at("frequency_hz").get<double>(), f, 1e-12 * f);
    EXPECT_NEAR(mode.at("damping_ratio").get<double>(), decay / omega, 1e-12);
    EXPECT_NEAR(mode.at("damped_frequency_hz").get<double>(), f * std::sqrt(1.0 - decay * decay / (omega * omega)),
                1e-9);
  }
  EXPECT_THAT(bytes("f.csv"), HasSubstr("\"block\",1,20,"));
  EXPECT_TRUE(report.at("warnings").empty());
}

TEST_F(Programs, InspectWarnsOfWhatMaySurprise) {
  auto data = testing::block_data(2, "odd");
  data.eigenvalues[0] = 0.0;
  data.render.triangles.pop_back();
  Asset asset;
  asset.bodies = {std::make_shared<const ModalModel>(std::move(data))};
  write_asset(folder_ / "odd.glb", asset);
  const ProgramResult r = run("limber-inspect", {"odd.glb"});
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.err, HasSubstr("mechanisms"));
  EXPECT_THAT(r.err, HasSubstr("3 boundary edges"));
}

TEST_F(Programs, BenchmarkStepTellsWhatEachStageOfASceneCosts) {
  const ProgramResult r =
      run("limber-benchmark", {"step", "--scene", "scene.json", "--csv", "b.csv", "--report", "b.json"});
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const std::string csv = bytes("b.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 2);
  const auto report = json("b.json");
  ASSERT_EQ(report.at("scenes").size(), 1u);
  EXPECT_EQ(report.at("scenes")[0].at("unsettled_steps"), 0);
  const auto& times = report.at("seconds").at("scenes")[0];
  EXPECT_GT(times.at("step").at("median").get<double>(), 0.0);
  EXPECT_LE(times.at("step").at("median"), times.at("step").at("p99"));
  EXPECT_LE(times.at("step").at("p99"), times.at("step").at("worst"));
  EXPECT_LE(times.at("positions").at("median"), times.at("positions_and_normals").at("median"));
  double shares = 0.0;
  for (const auto& stage : times.at("stages")) {
    EXPECT_GE(stage.at("per_unit").get<double>(), 0.0);
    shares += stage.at("share").get<double>();
  }
  EXPECT_NEAR(shares, 1.0, 1e-9);
}

// In half of the steps the block lies on the ground.
TEST_F(Programs, BenchmarkStepRehearsedTakesTheSameSteps) {
  write_file(folder_ / "scene.json", R"({
    "step": 0.01, "duration": 0.4, "assets": {"block": "block.glb"},
    "statics": [{"name": "ground", "shape": {"half_space": {}}}],
    "bodies": [{"name": "falls", "asset": "block", "position": [0, 0, 0.7]}]})");
  const auto report_of = [this](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--report", "r.json"});
    EXPECT_EQ(run("limber-benchmark", arguments).exit_code, 0);
    return json("r.json");
  };
  const auto plain = report_of({"step", "--scene", "scene.json"});
  const auto rehearsed = report_of({"step", "--scene", "scene.json", "--rehearse"});
  EXPECT_GT(plain.at("scenes")[0].at("contacts_per_step"), 0.0);
  EXPECT_EQ(plain.at("rehearsed"), false);
  EXPECT_EQ(rehearsed.at("rehearsed"), true);
  EXPECT_EQ(plain.at("scenes"), rehearsed.at("scenes"));
}

TEST_F(Programs, BenchmarkRefusesWhatItCannotMeasure) {
  expect_one_line(run("limber-benchmark", {}), 2, "subcommand");
  expect_one_line(run("limber-benchmark", {"step", "--bodies", "0"}), 2, "--bodies");
  expect_one_line(run("limber-benchmark", {"step", "--mdoes", "3"}), 2, "did you mean \"--modes\"");
  expect_one_line(run("limber-benchmark", {"step", "--scene", "missing.json"}), 1, "missing.json");
  expect_one_line(run("limber-benchmark", {"step", "--scene", "scene.json", "--modes", "3"}), 2, "own size");
  EXPECT_EQ(files(), given_);
}

}  // namespace
}  // namespace limber
