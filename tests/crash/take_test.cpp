// Takes of the real nodald on a real file system: stopped, killed while recording, refused.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <csignal>
#include <fstream>

#include "nodald_process.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"
#include "protocol/upload.h"
#include "tests/scenario/small_rig.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::crash {
namespace {

namespace fs = std::filesystem;

/// The number of the take that has begun; 0 and a failure if there is none.
std::uint64_t start_take(LinkHost& host) {
  EXPECT_TRUE(host.wait_for([](const wire::RigStatus& status) { return status.full_sets() > 3; }));
  const auto reply = host.ask([](wire::Request& request) { request.mutable_take_start(); });
  EXPECT_TRUE(reply && reply->has_take()) << (reply ? reply->error().message() : "no answer");
  return reply ? reply->take().take() : 0;
}

bool wait_for_sets(LinkHost& host, std::uint64_t sets) {
  return host.wait_for([&](const wire::RigStatus& status) { return status.recording().sets() >= sets; });
}

/// At most, by a file system's blocks.
constexpr std::uint64_t kRoundedUp = 256 << 10;

/// Checks every file of a take against its manifest and its evidence, and with ffprobe. Returns its sets.
std::uint64_t check(const fs::path& folder) {
  const auto text = test::read_bytes(folder / take::kManifestFile);
  const auto manifest =
      take::parse_manifest({reinterpret_cast<const char*>(text.data()), text.size()}, folder.string());
  EXPECT_TRUE(manifest) << manifest.error().text();
  if (!manifest) return 0;
  std::uint64_t sets = 0;
  for (const take::Manifest::File& file : manifest->files) {
    const auto bytes = test::read_bytes(folder / file.name);
    EXPECT_EQ(bytes.size(), file.bytes) << file.name;
    struct stat about {};
    EXPECT_EQ(::stat((folder / file.name).c_str(), &about), 0);
    EXPECT_LT(static_cast<std::uint64_t>(about.st_blocks) * 512, file.bytes + kRoundedUp)
        << file.name << ": room that was not used is given back";
    take::PieceHashes hashes;
    hashes.update(bytes);
    EXPECT_EQ(take::digest_of(hashes.all()), file.digest) << file.name;
    if (!file.name.starts_with("evidence")) continue;
    const auto segment = take::read_evidence(bytes, file.name);
    EXPECT_TRUE(segment && segment->end) << file.name;
    if (!segment) continue;
    sets += segment->sets.size();
    if (test::Process({"sh", "-c", "command -v ffprobe"}).wait().code != 0) continue;
    for (const take::wire::File& video : segment->begin.files()) {
      const test::Finished probed =
          test::Process({"ffprobe", "-v", "error", "-count_packets", "-select_streams", "v", "-show_entries",
                         "stream=nb_read_packets", "-of", "default=nk=1:nw=1", (folder / video.name()).string()})
              .wait();
      const std::size_t frames = video.has_head() ? segment->sets.size() : segment->raymaps.size();
      EXPECT_EQ(probed.out, std::to_string(frames) + "\n") << video.name();
    }
  }
  EXPECT_EQ(sets, manifest->sets);
  return sets;
}

TEST(RecordedTakes, StartedMarkedAndStopped_AreOnTheDiskAndInTheList) {
  const RecordingRig folder;
  test::Process daemon(nodald({"--config", folder.config()}));
  const auto host = LinkHost::connect(folder.socket());
  ASSERT_TRUE(host) << daemon.complained();
  ASSERT_TRUE(host->upload_and_commit(to_json(scenario::small_calibration("truth"))));
  ASSERT_TRUE(host->wait_for([](const wire::RigStatus& status) { return !status.calibration_id().empty(); }));
  ASSERT_EQ(start_take(*host), 1U);
  const auto second = host->ask([](wire::Request& request) { request.mutable_take_start(); });
  ASSERT_TRUE(second && second->has_error());
  EXPECT_NE(second->error().message().find("take 1 is being recorded"), std::string::npos);
  ASSERT_TRUE(wait_for_sets(*host, 30));
  ASSERT_TRUE(host->ask([](wire::Request& request) { request.mutable_take_mark()->set_text("here"); })->has_take());
  const auto refused = host->ask([](wire::Request& request) { request.mutable_take_delete()->set_take(1); });
  ASSERT_TRUE(refused && refused->has_error());
  ASSERT_TRUE(host->ask([](wire::Request& request) { request.mutable_take_stop(); })->has_take());
  const auto listed = host->ask([](wire::Request& request) { request.mutable_take_list(); });
  ASSERT_TRUE(listed);
  ASSERT_EQ(listed->takes().takes_size(), 1);
  const wire::TakeEntry& take = listed->takes().takes(0);
  EXPECT_EQ(take.state(), "complete");
  EXPECT_EQ(take.ended(), "stopped");
  EXPECT_EQ(take.sets(), check(folder.path / "takes/000001"));
  EXPECT_GE(take.sets(), 30U);
  EXPECT_TRUE(fs::exists(folder.path / "takes/000001/raymap-0000.mkv"));
  const auto evidence = test::read_bytes(folder.path / "takes/000001/evidence-0000");
  const auto segment = take::read_evidence(evidence, "evidence-0000");
  ASSERT_TRUE(segment);
  ASSERT_EQ(segment->marks.size(), 1U);
  EXPECT_EQ(segment->marks[0].text(), "here");

  const auto verify = [&] {
    return test::Process({NODAL_BIN_DIR "/nodal", "take", "verify", (folder.path / "takes/000001").string()}).wait();
  };
  EXPECT_EQ(verify().code, 0);
  const fs::path picture = folder.path / "takes/000001/cam1-0000.mkv";
  const auto whole = test::read_bytes(picture);
  auto damaged = whole;
  damaged[damaged.size() / 2] ^= 1;
  test::write_bytes(picture, damaged);
  const test::Finished judged = verify();
  EXPECT_EQ(judged.code, 8);
  EXPECT_NE(judged.out.find("cam1-0000.mkv: 1 of "), std::string::npos) << judged.out;
  test::write_bytes(picture, {whole.begin(), whole.end() - 1});
  EXPECT_EQ(verify().code, 8);
  fs::remove(picture);
  fs::create_symlink("/dev/zero", picture);
  EXPECT_EQ(verify().code, 8);
  fs::remove(picture);
  test::write_bytes(picture, whole);
  EXPECT_EQ(verify().code, 0);

  ASSERT_TRUE(host->ask([](wire::Request& request) {
                    request.mutable_take_protect()->set_take(1);
                    request.mutable_take_protect()->set_on(true);
                  })
                  ->has_take());
  const auto kept = host->ask([](wire::Request& request) { request.mutable_take_delete()->set_take(1); });
  EXPECT_TRUE(kept && kept->has_error());
  ASSERT_TRUE(host->ask([](wire::Request& request) { request.mutable_take_protect()->set_take(1); })->has_take());
  ASSERT_TRUE(host->ask([](wire::Request& request) { request.mutable_take_delete()->set_take(1); })->has_take());
  EXPECT_FALSE(fs::exists(folder.path / "takes/000001"));
  ASSERT_EQ(start_take(*host), 2U) << "a number is never used again";
  ASSERT_TRUE(wait_for_sets(*host, 5));
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(std::chrono::seconds(20)).code, 0) << daemon.complained();
  EXPECT_GE(check(folder.path / "takes/000002"), 5U) << "a take that runs when nodald ends is finished";
}

TEST(RecordedTakes, NodaldKilledWhileRecording_EveryTakeIsWholeAfterTheNextStart) {
  const RecordingRig folder;
  constexpr std::uint64_t kKills = 5;
  for (std::uint64_t kill = 1; kill <= kKills + 1; ++kill) {
    test::Process daemon(nodald({"--config", folder.config()}));
    const auto host = LinkHost::connect(folder.socket());
    ASSERT_TRUE(host) << daemon.complained();
    // What the last kill left is finished by now or soon.
    ASSERT_TRUE(test::wait_until([&] {
      const auto listed = host->ask([](wire::Request& request) { request.mutable_take_list(); });
      EXPECT_TRUE(listed);
      if (!listed) return true;
      EXPECT_EQ(listed->takes().takes_size(), static_cast<int>(kill - 1));
      bool finished = true;
      for (const wire::TakeEntry& take : listed->takes().takes()) {
        finished &= take.state() == "complete" || take.state() == "damaged";
        EXPECT_NE(take.state(), "damaged") << take.problem();
      }
      return finished;
    }));
    if (kill > 1) {
      char name[16];
      std::snprintf(name, sizeof name, "%06d", static_cast<int>(kill - 1));
      EXPECT_GE(check(folder.path / "takes" / name), 8 * (kill - 1) - 1) << "all sets that the status had counted";
    }
    if (kill > kKills) break;
    ASSERT_EQ(start_take(*host), kill);
    ASSERT_TRUE(wait_for_sets(*host, 8 * kill));
    daemon.signal(SIGKILL);
    ASSERT_EQ(daemon.wait(std::chrono::seconds(20)).code, 128 + SIGKILL);
  }
}

TEST(RecordedTakes, ATestOfTheDisk_SaysWhatItTakesAndLeavesNothingAlsoWhenNodaldIsKilled) {
  const RecordingRig folder;
  const fs::path file = folder.path / "takes" / "disk-test";
  const auto command = [&](const std::string& length) -> std::vector<std::string> {
    return {NODAL_BIN_DIR "/nodal", "--rig", "unix:" + folder.socket(), "disk", "test", "--for", length};
  };
  {
    test::Process daemon(nodald({"--config", folder.config()}));
    const auto host = LinkHost::connect(folder.socket());
    ASSERT_TRUE(host) << daemon.complained();
    ASSERT_TRUE(
        test::wait_until([&] { return host->pump() && host->status().value_or(wire::RigStatus()).full_sets() > 3; }));
    const test::Finished done = test::Process(command("1s")).wait();
    // A disk that is busy with other things may be too slow for every mode.
    EXPECT_TRUE(done.code == 0 || done.code == 8) << done.code << done.err;
    EXPECT_NE(done.out.find("the longest sync took"), std::string::npos) << done.out;
    for (const char* mode : {"mode = \"driver\": ", "mode = \"jpeg\": "}) {
      EXPECT_NE(done.out.find(mode), std::string::npos) << done.out;
    }
    EXPECT_FALSE(fs::exists(file));
    const test::Finished refused = test::Process(command("120s")).wait();
    EXPECT_NE(refused.code, 0);
    EXPECT_NE(refused.err.find("lasts 1 s to 60 s"), std::string::npos) << refused.err;

    test::Process running(command("20s"));
    ASSERT_TRUE(test::wait_until([&] { return fs::exists(file) && fs::file_size(file) > 0; }));
    daemon.signal(SIGKILL);
    EXPECT_EQ(daemon.wait(std::chrono::seconds(20)).code, 128 + SIGKILL);
    EXPECT_NE(running.wait(std::chrono::seconds(30)).code, 0);
  }
  ASSERT_TRUE(fs::exists(file));
  test::Process daemon(nodald({"--config", folder.config()}));
  ASSERT_TRUE(LinkHost::connect(folder.socket())) << daemon.complained();
  EXPECT_TRUE(test::wait_until([&] { return !fs::exists(file); }));
}

}  // namespace
}  // namespace nodal::crash
