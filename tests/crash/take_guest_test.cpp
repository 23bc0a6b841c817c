// The takes' folder of the real nodald is that of a guest: a second nodald, cards that are exchanged, people who bring
// takes.
#include <gtest/gtest.h>
#include <sys/mount.h>

#include <csignal>
#include <fstream>

#include "nodald_process.h"
#include "protocol/take/documents.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::crash {
namespace {

namespace fs = std::filesystem;
using test::wait_until;

const std::string kNoRaymap = "raymap = false\n";

/// Number of the take; 0 and the message if there is none.
std::pair<std::uint64_t, std::string> start(LinkHost& host) {
  EXPECT_TRUE(host.wait_for([](const wire::RigStatus& status) { return status.full_sets() > 3; }));
  const auto reply = host.ask([](wire::Request& request) { request.mutable_take_start(); });
  if (!reply) return {0, "no answer"};
  return {reply->take().take(), reply->error().message()};
}

bool stop(LinkHost& host) {
  EXPECT_TRUE(host.wait_for([](const wire::RigStatus& status) { return status.recording().sets() > 3; }));
  const auto reply = host.ask([](wire::Request& request) { request.mutable_take_stop(); });
  return reply && reply->has_take();
}

std::vector<std::uint64_t> list(LinkHost& host) {
  std::vector<std::uint64_t> numbers;
  const auto reply = host.ask([](wire::Request& request) { request.mutable_take_list(); });
  if (!reply) return numbers;
  for (const wire::TakeEntry& take : reply->takes().takes()) numbers.push_back(take.number());
  return numbers;
}

/// Descriptors of the process that lead into the folder.
int open_in(pid_t process, const fs::path& folder) {
  int count = 0;
  std::error_code gone;
  for (const auto& entry : fs::directory_iterator("/proc/" + std::to_string(process) + "/fd", gone)) {
    const std::string to = fs::read_symlink(entry.path(), gone).string();
    count += !gone && to.starts_with(folder.string()) ? 1 : 0;
  }
  return count;
}

TEST(GuestDisk, ASecondNodaldOnTheFolder_EndsAndSaysWhyAndTheTakeGoesOn) {
  const RecordingRig first("takes", kNoRaymap);
  const RecordingRig second((first.path / "takes").string(), kNoRaymap);
  test::Process daemon(nodald({"--config", first.config()}));
  const auto host = LinkHost::connect(first.socket());
  ASSERT_TRUE(host) << daemon.complained();
  ASSERT_EQ(start(*host).first, 1U);
  test::Process other(nodald({"--config", second.config()}));
  EXPECT_EQ(other.wait(std::chrono::seconds(60)).code, 3);
  EXPECT_NE(other.complained().find("another nodald uses the takes folder"), std::string::npos) << other.complained();
  EXPECT_TRUE(stop(*host));
  const std::string verified = NODAL_BIN_DIR "/nodal";
  EXPECT_EQ(test::Process({verified, "take", "verify", (first.path / "takes/000001").string()}).wait().code, 0);
}

TEST(GuestDisk, ASecondNodaldOnTheStore_EndsAndSaysWhy) {
  const RigFolder first;
  const RigFolder second;
  test::Process daemon(nodald({"--config", first.config(), "--store", (first.path / "shared").string()}));
  ASSERT_TRUE(LinkHost::connect(first.socket())) << daemon.complained();
  test::Process other(nodald({"--config", second.config(), "--store", (first.path / "shared").string()}));
  EXPECT_EQ(other.wait(std::chrono::seconds(60)).code, 3);
  EXPECT_NE(other.complained().find("another nodald uses it"), std::string::npos) << other.complained();
}

TEST(GuestDisk, NothingIsRecorded_NothingIsOpenThereAndATakeBroughtMeanwhileKeepsItsBytes) {
  const RecordingRig rig("takes", kNoRaymap);
  const fs::path takes = rig.path / "takes";
  test::Process daemon(nodald({"--config", rig.config()}));
  const auto host = LinkHost::connect(rig.socket());
  ASSERT_TRUE(host) << daemon.complained();
  EXPECT_TRUE(wait_until([&] { return open_in(daemon.pid(), takes) == 0; }));
  ASSERT_EQ(start(*host).first, 1U);
  EXPECT_GT(open_in(daemon.pid(), takes), 0);
  ASSERT_TRUE(stop(*host));
  EXPECT_TRUE(wait_until([&] { return open_in(daemon.pid(), takes) == 0; }));
  fs::copy(takes / "000001", takes / "000002", fs::copy_options::recursive);
  const auto brought = test::read_bytes(takes / "000002/cam0-0000.mkv");
  ASSERT_EQ(start(*host).first, 3U);
  ASSERT_TRUE(stop(*host));
  EXPECT_EQ(test::read_bytes(takes / "000002/cam0-0000.mkv"), brought);
  EXPECT_EQ(list(*host), (std::vector<std::uint64_t>{1, 2, 3}));
  fs::remove_all(takes / "000001");
  EXPECT_EQ(list(*host), (std::vector<std::uint64_t>{2, 3}));
}

TEST(GuestDisk, Ejected_TheTakeIsFinishedAndNothingIsOpenThere) {
  const RecordingRig rig("takes", kNoRaymap);
  test::Process daemon(nodald({"--config", rig.config()}));
  const auto host = LinkHost::connect(rig.socket());
  ASSERT_TRUE(host) << daemon.complained();
  ASSERT_EQ(start(*host).first, 1U);
  ASSERT_TRUE(host->wait_for([](const wire::RigStatus& status) { return status.recording().sets() > 3; }));
  const test::Finished ejected =
      test::Process({NODAL_BIN_DIR "/nodal", "--rig", "unix:" + rig.socket(), "disk", "eject"}).wait();
  EXPECT_EQ(ejected.code, 0) << ejected.err;
  EXPECT_NE(ejected.out.find("take 1 is finished"), std::string::npos) << ejected.out;
  EXPECT_NE(ejected.out.find("it can be removed"), std::string::npos) << ejected.out;
  EXPECT_EQ(open_in(daemon.pid(), rig.path / "takes"), 0);
  EXPECT_TRUE(fs::exists(rig.path / "takes/000001" / take::kManifestFile));
  const auto status = [&](std::vector<std::string> words) {
    words.insert(words.begin(), {NODAL_BIN_DIR "/nodal", "--rig", "unix:" + rig.socket()});
    return test::Process(words).wait().out;
  };
  test::wait_until([&] { return status({"status"}).find("the disk was ejected") != std::string::npos; });
  const std::string text = status({"status"});
  EXPECT_NE(text.find("none is being recorded: the disk was ejected"), std::string::npos) << text;
  EXPECT_EQ(text.find("degraded"), std::string::npos) << text;
  EXPECT_NE(status({"status", "--json"}).find("\"ejected\":true"), std::string::npos);
}

TEST(GuestDisk, NoCardIsMounted_TheRigRunsAndATakeIsRefusedUntilThereIsOne) {
  const RecordingRig rig("card", kNoRaymap + "mounted = true\n");
  fs::create_directory(rig.path / "card");
  test::Process daemon(nodald({"--config", rig.config()}));
  const auto host = LinkHost::connect(rig.socket());
  ASSERT_TRUE(host) << daemon.complained();
  EXPECT_NE(start(*host).second.find("no disk is mounted there"), std::string::npos);
  EXPECT_NE(host->status()->recording().problem().find("no disk is mounted there"), std::string::npos);
  EXPECT_TRUE(fs::is_empty(rig.path / "card"));
}

/// A file system in memory; unmounted when it is destroyed.
class Card {
 public:
  explicit Card(fs::path place) : place_(std::move(place)) {
    present_ = ::mount("card", place_.c_str(), "tmpfs", 0, "size=600m") == 0;
  }
  ~Card() {
    if (present_) ::umount2(place_.c_str(), MNT_DETACH);
  }
  bool present() const { return present_; }
  /// As `umount`, and as `umount -l`.
  bool unmount(bool lazy = false) {
    if (::umount2(place_.c_str(), lazy ? MNT_DETACH : 0) != 0) return false;
    present_ = false;
    return true;
  }

 private:
  const fs::path place_;
  bool present_;
};

TEST(GuestDisk, ACardIsExchanged_ItCanBeUnmountedAndTheNextTakeIsOnTheOneThatIsMounted) {
  const RecordingRig rig("card", kNoRaymap + "mounted = true\nstart = \"boot\"\n");
  const fs::path place = rig.path / "card";
  fs::create_directory(place);
  Card first(place);
  if (!first.present()) GTEST_SKIP() << "mounting needs root";
  test::Process daemon(nodald({"--config", rig.config()}));
  const auto host = LinkHost::connect(rig.socket());
  ASSERT_TRUE(host) << daemon.complained();
  ASSERT_TRUE(host->wait_for([](const wire::RigStatus& status) { return status.recording().sets() > 3; }));
  ASSERT_TRUE(host->ask([](wire::Request& request) { request.mutable_disk_eject(); })->has_take());
  ASSERT_TRUE(first.unmount());
  Card second(place);
  ASSERT_TRUE(second.present());
  ASSERT_TRUE(host->wait_for([](const wire::RigStatus& status) { return status.recording().sets() > 3; }))
      << "start = \"boot\" goes on with the new card";
  EXPECT_TRUE(fs::exists(place / "000002"));
  ASSERT_FALSE(second.unmount()) << "a take is recorded";
  ASSERT_TRUE(second.unmount(true));
  Card third(place);
  ASSERT_TRUE(third.present());
  ASSERT_TRUE(host->wait_for([](const wire::RigStatus& status) { return status.recording().take() == 3; }));
  ASSERT_TRUE(stop(*host));
  EXPECT_EQ(list(*host), std::vector<std::uint64_t>{3});
  EXPECT_TRUE(fs::exists(place / "000003" / take::kManifestFile));
  EXPECT_TRUE(wait_until([&] { return third.unmount(); }));
  EXPECT_NE(start(*host).second.find("no disk is mounted there"), std::string::npos);
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(std::chrono::seconds(60)).code, 0);
}

}  // namespace
}  // namespace nodal::crash
