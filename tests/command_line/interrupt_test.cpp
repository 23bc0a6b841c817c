// Ctrl-C while `nodal` computes: it ends at once, with a message, and writes no file.
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "protocol/calibration.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"
#include "tests/support/rendered_rig.h"

namespace nodal::command_line {
namespace {

using test::Finished;
using test::Process;
using Words = std::vector<std::string>;

/// CPU seconds of all its threads, from /proc/PID/stat.
double computed(const Process& process) {
  std::ifstream file("/proc/" + std::to_string(process.pid()) + "/stat");
  std::string text{std::istreambuf_iterator<char>(file), {}};
  std::istringstream rest(text.substr(std::min(text.rfind(')') + 1, text.size())));
  std::string field;
  double ticks = 0;
  for (int i = 3; rest >> field && i <= 15; ++i) {
    if (i == 14 || i == 15) ticks += std::stod(field);  // user, system
  }
  return ticks / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

/// Pictures for which each of the commands takes far longer than the test waits.
class Interrupt : public testing::Test {
 protected:
  static constexpr int kSide = 640;
  static constexpr double kBegun = 0.15;  ///< s of CPU time; the shortest of the commands takes 0.5 s on a fast machine

  /// At most a second on a machine with nothing else to do; tests run beside others.
  static constexpr std::chrono::seconds kEnd{5};

  static void SetUpTestSuite() {
    folder_ = new test::TemporaryFolder;
    const Calibration truth = test::six_fisheyes(kSide);
    const test::RenderedRig rig =
        test::render_rig(truth, hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 1.0, 5, 1});
    std::filesystem::create_directories(*folder_ / "frames");
    for (std::size_t h = 0; h < rig.bytes.size(); ++h) {
      test::write_bytes(*folder_ / ("frames/" + truth.heads[h].name + ".png"),
                        test::png_of(rig.bytes[h], kSide, kSide, 1));
    }
    std::ofstream(*folder_ / "prior.json") << to_json(test::turned(truth, 1, 3, 3));
    // Not a photograph of a pattern, so every search for it is exhaustive.
    std::mt19937 random(5);
    for (const char* name : {"a.png", "b.png", "c.png"}) {
      std::vector<std::uint8_t> noise(std::size_t{2000} * 1500);
      for (std::uint8_t& sample : noise) sample = static_cast<std::uint8_t>(random());
      test::write_bytes(*folder_ / name, test::png_of(noise, 2000, 1500, 1));
    }
  }
  static void TearDownTestSuite() { delete folder_; }

  static std::string path(const std::string& name) { return (*folder_ / name).string(); }

  void expect_the_end_at_once(Words words, int signal, int code, const std::string& out = "out.json") {
    words.insert(words.begin(), {NODAL_BIN_DIR "/nodal", "--json"});
    words.insert(words.end(), {"-o", path(out)});
    Process nodal(words);
    double most = 0;
    const auto computes = [&] {
      most = std::max(most, computed(nodal));
      return most > kBegun;
    };
    ASSERT_TRUE(test::wait_until(computes)) << "it computed for " << most << " s and was done";
    const auto asked = std::chrono::steady_clock::now();
    nodal.signal(signal);
    const Finished run = nodal.wait();
    EXPECT_LT(std::chrono::steady_clock::now() - asked, kEnd);
    EXPECT_EQ(run.code, code) << run.out << run.err;
    EXPECT_NE(run.err.find("nodal: cancelled (603): stopped by a signal before the work was done"), std::string::npos)
        << run.err;
    EXPECT_EQ(nlohmann::json::parse(run.out)["error"]["name"], "cancelled");
    EXPECT_FALSE(std::filesystem::exists(path(out)));
  }

 private:
  static test::TemporaryFolder* folder_;
};

test::TemporaryFolder* Interrupt::folder_ = nullptr;

TEST_F(Interrupt, WhileHeadsAreRegistered_EndsAtOnce) {
  expect_the_end_at_once({"register", path("prior.json"), path("frames"), "--free", "lens"}, SIGINT, 130);
  expect_the_end_at_once({"register", path("prior.json"), path("frames"), "--free", "lens"}, SIGTERM, 143);
}

TEST_F(Interrupt, WhileDriftIsMeasured_EndsAtOnce) {
  expect_the_end_at_once({"drift", path("prior.json"), path("frames")}, SIGINT, 130);
}

TEST_F(Interrupt, WhilePicturesAreStitched_EndsAtOnce) {
  expect_the_end_at_once({"stitch", path("frames")}, SIGINT, 130, "out.png");
  expect_the_end_at_once({"stitch", path("prior.json"), path("frames"), "--width", "8000"}, SIGINT, 130, "out.png");
}

TEST_F(Interrupt, WhileALensIsCalibrated_EndsAtOnce) {
  expect_the_end_at_once({"calibrate", "lens", path("a.png"), path("b.png"), path("c.png")}, SIGINT, 130);
}

TEST_F(Interrupt, WhileLightIsCalibrated_EndsAtOnce) {
  expect_the_end_at_once(
      {"calibrate", "light", path("prior.json"), path("frames"), path("frames"), path("frames"), "--own-vignetting"},
      SIGINT, 130);
}

}  // namespace
}  // namespace nodal::command_line
