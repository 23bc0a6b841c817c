// nodald and nodal under Valgrind's memory checker: reads of memory that was not written or not allocated, and leaks.
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>

#include "rig_process.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

constexpr int kFound = 99;  ///< the exit code after an error that Valgrind found
constexpr std::chrono::seconds kAtMost{300};

class Memcheck : public RigTest {
 protected:
  void SetUp() override {
    if (!fs::exists("/usr/bin/valgrind")) GTEST_SKIP() << "valgrind is not installed: no memory is checked";
    under_ = {"valgrind",
              "-q",
              "--error-exitcode=" + std::to_string(kFound),
              "--leak-check=full",
              "--show-leak-kinds=definite,indirect",
              "--errors-for-leak-kinds=definite,indirect",
              "--fair-sched=yes"};
    environment_["NODAL_CONFINE"] = "off";  // Valgrind writes its own files
    environment_["LD_PRELOAD"] = NODAL_BIN_DIR "/libmemcheck_preload.so";
    std::string toml = read("rig.toml");
    const std::string rate = "rate = \"25\"";
    toml.replace(toml.find(rate), rate.size(),
                 "rate = \"2\"");  // a program under Valgrind takes 20 to 50 times as long
    write("rig.toml", toml + "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n");
    fs::create_directories(path("takes"));
  }
  /// A command that must succeed without an error that Valgrind finds.
  std::string run(const Words& words) const {
    const Finished done = start(words)->wait(kAtMost);
    EXPECT_EQ(done.code, 0) << testing::PrintToString(words) << done.out << done.err;
    return done.out;
  }
};

TEST_F(Memcheck, ARigThatIsAskedForItsStateAndEnds_HasNoErrorAndNoLeak) {
  start_nodald();
  run({"status"});
  nodald().signal(SIGTERM);
  const Finished ended = nodald().wait(kAtMost);
  EXPECT_EQ(ended.code, 0) << ended.err;
}

TEST_F(Memcheck, ARigThatFilmsAndAHostThatUsesEveryCommand_HaveNoErrorAndNoLeak) {
  if (std::getenv("NODAL_VALGRIND") == nullptr) GTEST_SKIP() << "takes a minute and a half: tests/run --valgrind";
  start_nodald();
  const std::string six = path("six.json");
  run({"calibration", "upload", six});
  run({"genlock", "start"});
  run({"head", "set", "cam0", "--exposure", "5ms"});
  run({"take", "start"});
  run({"raymap", "pull", "-n", "3", "--out", path("raymap-%d.jpg")});
  run({"raymap", "pull", "-n", "2", "--out", path("raymap-%d.png")});
  run({"take", "mark", "here"});
  run({"take", "stop"});
  for (const Words& words : std::vector<Words>{{"status"},
                                               {"heads", "--wide"},
                                               {"hosts"},
                                               {"audit"},
                                               {"genlock", "show"},
                                               {"exposure", "show"},
                                               {"exposure", "set", "each"},
                                               {"sync", "report", "-n", "4"},
                                               {"calibration", "list"},
                                               {"calibration", "show"},
                                               {"take", "still"},
                                               {"take", "list"},
                                               {"offload", "--new", "--to", path("copies")},
                                               {"genlock", "stop"}}) {
    run(words);
  }
  nodald().signal(SIGTERM);
  const Finished ended = nodald().wait(kAtMost);
  EXPECT_EQ(ended.code, 0) << ended.err;

  const std::string take = path("copies/000001");
  for (const Words& words :
       std::vector<Words>{{"take", "show", take},
                          {"take", "verify", take},
                          {"take", "export", take, "--to", path("films")},
                          {"render", take, "--out", path("rendered.mkv")},
                          {"convert", path("raymap-1.jpg"), "-o", path("cube.png"), "--layout", "cube"},
                          {"view", path("raymap-1.jpg"), "-o", path("view.jpg"), "--yaw", "30"},
                          {"calibration", "check", six},
                          {"calibration", "diff", six, path("truth.json")},
                          {"export", six, "--format", "pto", "-o", path("six.pto")},
                          {"import", path("six.pto"), "-o", path("again.json")},
                          {"mesh", "--size", "256x128", "-o", path("mesh.glb")},
                          {"pattern", "-o", path("pattern.pdf")},
                          {"completion", "bash"}}) {
    run(words);
  }
}

TEST_F(Memcheck, APlantedLeak_IsFound) {
  EXPECT_EQ(start({"--version"})->wait(kAtMost).code, 0);
  environment_["NODAL_PLANT_LEAK"] = "1";
  EXPECT_EQ(start({"--version"})->wait(kAtMost).code, kFound);
}

}  // namespace
}  // namespace nodal::command_line
