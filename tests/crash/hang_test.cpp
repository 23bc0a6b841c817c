// A thread of nodald that hangs in a call, and FIFOs in places where a file belongs: nothing waits for ever.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>

#include "nodald_process.h"
#include "tests/support/process.h"

namespace nodal::crash {
namespace {

/// nodald with a thread that hangs while a file exists.
class HangingRig {
 public:
  explicit HangingRig(const std::string& thread) : thread_(thread) {
    std::ofstream(folder.path / "rig.toml", std::ios::app) << "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n";
  }
  void start() {
    const std::map<std::string, std::string> environment{{"LD_PRELOAD", NODAL_BIN_DIR "/libhang.so"},
                                                         {"NODAL_HANG_THREAD", thread_},
                                                         {"NODAL_HANG_WHILE", file().string()}};
    daemon.emplace(nodald({"--config", folder.config()}), environment);
  }
  void hang() { std::ofstream(file()) << "2 bytes"; }
  /// Whether the thread hangs, within a minute.
  bool hangs() const {
    return test::wait_until([&] {
      std::error_code error;
      return std::filesystem::file_size(file(), error) == 1;
    });
  }
  void go_on() { std::filesystem::remove(file()); }
  std::filesystem::path file() const { return folder.path / "hang"; }

  RigFolder folder;
  std::optional<test::Process> daemon;

 private:
  const std::string thread_;
};

bool has(test::Process& daemon, const std::string& line) { return daemon.complained().find(line) != std::string::npos; }

TEST(Hangs, OfTheCaptureStage_SigtermStillEndsItAndTheOutputsAreSafe) {
  HangingRig rig("nodal-capture");
  rig.start();
  ASSERT_TRUE(LinkHost::connect(rig.folder.socket())) << rig.daemon->complained();
  rig.hang();
  ASSERT_TRUE(rig.hangs());
  rig.daemon->signal(SIGTERM);
  EXPECT_EQ(rig.daemon->wait(std::chrono::seconds(60)).code, 4) << rig.daemon->complained();
  EXPECT_TRUE(has(*rig.daemon, "nodal-capture hangs; outputs are at their safe levels")) << rig.daemon->complained();
}

TEST(Hangs, OfTheTakesDisk_TheRigIsDegradedAndRunsAgainByItself) {
  HangingRig rig("nodal-takes");
  rig.start();
  const auto host = LinkHost::connect(rig.folder.socket());
  ASSERT_TRUE(host) << rig.daemon->complained();
  std::ifstream truth(rig.folder.path / "truth.json");
  ASSERT_TRUE(host->upload_and_commit({std::istreambuf_iterator<char>(truth), {}}));
  ASSERT_TRUE(host->wait_for([](const wire::RigStatus& status) { return status.state() == "running"; }));
  wire::Request start;
  start.mutable_take_start();
  const auto started = host->ask(start);
  ASSERT_TRUE(started && started->has_take());
  rig.hang();
  ASSERT_TRUE(rig.hangs());
  EXPECT_TRUE(host->wait_for([](const wire::RigStatus& status) {
    return status.state() == "degraded" && status.problem() == "the takes' disk does not answer";
  })) << rig.daemon->complained();
  EXPECT_TRUE(test::wait_until([&] { return has(*rig.daemon, "the takes' disk does not answer"); }));
  rig.go_on();
  EXPECT_TRUE(host->wait_for([](const wire::RigStatus& status) {
    return status.problem() != "the takes' disk does not answer";
  })) << rig.daemon->complained();
  EXPECT_TRUE(test::wait_until([&] { return has(*rig.daemon, "the takes' disk answers again"); }));
  wire::Request stop;
  stop.mutable_take_stop();
  const auto stopped = host->ask(stop, 60);
  EXPECT_TRUE(stopped && stopped->has_take()) << (stopped ? stopped->error().message() : rig.daemon->complained());
}

TEST(Hangs, WhileItStarts_SigtermEndsIt) {
  HangingRig rig("nodald");
  rig.hang();
  rig.start();
  ASSERT_TRUE(rig.hangs()) << rig.daemon->complained();
  rig.daemon->signal(SIGTERM);
  EXPECT_EQ(rig.daemon->wait(std::chrono::seconds(60)).code, 0) << rig.daemon->complained();
}

/// A FIFO without a writer: a plain open() for reading blocks.
void make_fifo(const std::filesystem::path& file) {
  std::filesystem::remove_all(file);
  ASSERT_EQ(::mkfifo(file.c_str(), 0600), 0);
}

TEST(Fifos, InPlaceOfRigTomlAndOfTheTruth_NodaldSaysThatTheyAreNoFiles) {
  for (const char* name : {"rig.toml", "truth.json"}) {
    const RigFolder folder;
    make_fifo(folder.path / name);
    test::Process daemon(nodald({"--config", folder.config()}));
    const test::Finished ended = daemon.wait(std::chrono::seconds(60));
    EXPECT_EQ(ended.code, 2) << ended.err;
    EXPECT_NE(ended.err.find(std::string(name) + ": is not a regular file"), std::string::npos) << ended.err;
  }
}

TEST(Fifos, InPlaceOfAPictureToReplay_ThatHeadIsMissingAndTheOthersFilm) {
  const RigFolder folder;
  make_fifo(folder.path / "pipe.png");
  std::ofstream(folder.path / "rig.toml", std::ios::app) << "[[heads]]\nname = \"pipe\"\nport = \"replay:pipe.png\"\n";
  test::Process daemon(nodald({"--config", folder.config()}));
  const auto host = LinkHost::connect(folder.socket());
  ASSERT_TRUE(host) << daemon.complained();
  EXPECT_TRUE(host->wait_for([](const wire::RigStatus& status) { return status.frames_taken() > 20; }))
      << daemon.complained();
}

TEST(Fifos, InPlaceOfFilesOfTheHost_NodalSaysThatTheyAreNoFiles) {
  const RigFolder folder;
  make_fifo(folder.path / "pipe");
  const std::string pipe = (folder.path / "pipe").string();
  std::filesystem::create_directories(folder.path / "take");
  make_fifo(folder.path / "take" / "take.json");
  const std::string take = (folder.path / "take").string();
  const std::vector<std::vector<std::string>> commands{{"calibration", "check", pipe},
                                                       {"stitch", pipe, pipe, "-o", take + "/out.jpg"},
                                                       {"convert", pipe, "-o", take + "/out.jpg", "--layout", "cube"},
                                                       {"take", "show", take},
                                                       {"render", take}};
  for (std::vector<std::string> command : commands) {
    SCOPED_TRACE(command.front());
    command.insert(command.begin(), NODAL_BIN_DIR "/nodal");
    test::Process nodal(command);
    const test::Finished ended = nodal.wait(std::chrono::seconds(60));
    EXPECT_NE(ended.code, 0);
    EXPECT_LT(ended.code, 128) << "it hung";
    EXPECT_NE(ended.err.find("regular file"), std::string::npos) << ended.err;
  }
}

}  // namespace
}  // namespace nodal::crash
