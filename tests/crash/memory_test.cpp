// nodald when memory allocation fails: at its start, and in each of its threads while the rig runs.
#include <gtest/gtest.h>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>

#include "nodald_process.h"
#include "refuse_memory.h"
#include "tests/scenario/small_rig.h"
#include "tests/support/process.h"

namespace nodal::crash {
namespace {

using std::chrono::seconds;

// With every limit it either serves, or gives the reason in one sentence.
TEST(Memory, TooFewAddressesToStart_EndsWith3AndSaysWhatToChange) {
  int refused = 0;
  for (const int mib : {60, 80, 120, 180, 260, 380}) {
    const RigFolder folder;
    std::vector<std::string> command = nodald({"--config", folder.config(), "--blend-threads", "16"});
    command.insert(command.begin(), {"prlimit", "--as=" + std::to_string(mib * 1024 * 1024)});
    test::Process daemon(command);
    ASSERT_TRUE(test::wait_until([&] {
      const std::string said = daemon.complained();
      return said.find("hosts can connect") != std::string::npos || said.find("cannot start") != std::string::npos;
    })) << daemon.complained();
    daemon.signal(SIGTERM);
    const test::Finished finished = daemon.wait(seconds(20));
    // 1 if threads were created, but the first steps of a stage fail.
    EXPECT_TRUE(finished.code == 0 || finished.code == 1 || finished.code == 3)
        << finished.code << " at " << mib << " MiB\n"
        << finished.err;
    if (finished.code == 1) {
      EXPECT_NE(finished.err.find("was refused memory"), std::string::npos) << finished.err;
    }
    if (finished.code != 3) continue;
    ++refused;
    EXPECT_NE(finished.err.find("the limit (ulimit -v) is " + std::to_string(mib) + " MiB"), std::string::npos)
        << finished.err;
  }
  EXPECT_GT(refused, 0);
}

/// A nodald in which allocations of one thread can be refused.
class Refused : public testing::Test {
 protected:
  Refused() {
    const std::string file = (folder_.path / "refusal").string();
    const int fd = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    EXPECT_EQ(::ftruncate(fd, sizeof(Refusal)), 0);
    refusal_ = static_cast<Refusal*>(::mmap(nullptr, sizeof(Refusal), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0));
    ::close(fd);
    environment_ = {{"LD_PRELOAD", NODAL_BIN_DIR "/librefuse_memory.so"}, {kRefusalVariable, file}};
  }
  ~Refused() override { ::munmap(refusal_, sizeof(Refusal)); }

  /// Starts it, and waits until its calibration is in force and raymaps arrive.
  void start() {
    daemon_.emplace(nodald({"--config", folder_.config()}), environment_);
    host_ = LinkHost::connect(folder_.socket());
    ASSERT_TRUE(host_) << daemon_->complained();
    ASSERT_TRUE(host_->upload_and_commit(to_json(scenario::small_calibration("first"))));
    ASSERT_TRUE(commit_answered()) << daemon_->complained();
    wire::Request pull;
    pull.mutable_pull()->set_count(0);
    ASSERT_TRUE(host_->ask(pull));
    ASSERT_TRUE(test::wait_until([&] { return !host_->pump() || host_->raymaps >= 3; }));
  }

  std::optional<wire::Reply> commit_answered() {
    std::optional<wire::Reply> reply;
    test::wait_until([&] { return (reply = host_->take_reply(host_->last_id())) || !host_->pump(); });
    return reply;
  }

  void refuse(const char* thread, std::uint32_t from_bytes = 0) {
    std::strncpy(refusal_->thread, thread, kThreadName - 1);
    refusal_->from_bytes = from_bytes;
    refusal_->on.store(1);
  }

  /// Work for every stage; false if the rig has ended.
  bool keep_busy(int round) {
    wire::Request exposure;
    exposure.mutable_head_set()->add_heads(0);
    exposure.mutable_head_set()->set_exposure_ns(1'000'000 + 1'000 * static_cast<std::uint64_t>(round));
    if (!host_->ask(exposure) || !host_->status()) return false;
    return host_->upload_and_commit(to_json(scenario::small_calibration("next " + std::to_string(round)))) &&
           commit_answered();
  }

  RigFolder folder_;
  std::map<std::string, std::string> environment_;
  Refusal* refusal_ = nullptr;
  std::optional<test::Process> daemon_;
  std::unique_ptr<LinkHost> host_;
};

class RefusedThread : public Refused, public testing::WithParamInterface<const char*> {};

TEST_P(RefusedThread, WhileTheRigRuns_NodaldEndsInOneSentenceWithItsOutputsSafe) {
  start();
  refuse(GetParam());
  for (int round = 0; round < 20 && keep_busy(round); ++round) {}
  daemon_->signal(SIGTERM);
  const test::Finished finished = daemon_->wait(seconds(20));
  EXPECT_EQ(finished.code, 1) << finished.err;
  EXPECT_GT(refusal_->refused.load(), 0u);
  const std::string sentence =
      std::string("nodald: ") + GetParam() + " was refused memory; outputs are at their safe levels";
  EXPECT_NE(finished.err.find(sentence), std::string::npos) << finished.err;
}

INSTANTIATE_TEST_SUITE_P(Threads, RefusedThread,
                         testing::Values("nodald", "nodal-control", "nodal-keeper", "nodal-encode", "nodal-capture"),
                         [](const auto& thread) {
                           std::string name = thread.param;
                           std::erase(name, '-');
                           return name;
                         });

// There are several blending threads; they allocate all their memory at the start.
TEST_F(Refused, ToTheBlend_ChangesNothingSinceItAsksForNone) {
  start();
  refuse("nodal-blend");
  const std::size_t raymaps = host_->raymaps;
  EXPECT_TRUE(keep_busy(0));
  ASSERT_TRUE(test::wait_until([&] { return !host_->pump() || host_->raymaps >= raymaps + 3; }));
  daemon_->signal(SIGTERM);
  EXPECT_EQ(daemon_->wait(seconds(20)).code, 0) << daemon_->complained();
  EXPECT_EQ(refusal_->refused.load(), 0u);
}

TEST_F(Refused, ForATable_CostsThatCalibrationAndTheOldOneGoesOn) {
  start();
  const std::string before = host_->status()->calibration_id();
  refuse("nodal-keeper", 48 * 1024);  // its table needs at least this; documents of this rig are far smaller
  ASSERT_TRUE(host_->upload_and_commit(to_json(scenario::small_calibration("second"))));
  const auto refused = commit_answered();
  ASSERT_TRUE(refused) << daemon_->complained();
  EXPECT_EQ(refused->error().code(), static_cast<unsigned>(Errc::kOverload)) << refused->error().message();
  EXPECT_GT(refusal_->refused.load(), 0u);
  EXPECT_EQ(host_->status()->calibration_id(), before);
  const std::size_t raymaps = host_->raymaps;
  ASSERT_TRUE(test::wait_until([&] { return !host_->pump() || host_->raymaps >= raymaps + 3; }));
  refusal_->on.store(0);
  ASSERT_TRUE(host_->upload_and_commit(to_json(scenario::small_calibration("second"))));
  const auto done = commit_answered();
  ASSERT_TRUE(done);
  EXPECT_TRUE(done->has_done()) << done->error().message();
  EXPECT_NE(host_->status()->calibration_id(), before);
}

}  // namespace
}  // namespace nodal::crash
