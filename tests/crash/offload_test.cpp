// `nodal offload` from the real nodald: killed, unplugged and disturbed at many places, then run again.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "faulty_wire.h"
#include "firmware/record/loop.h"
#include "hal/linux/disk.h"
#include "nodald_process.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::crash {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using test::Finished;
using test::Process;

/// Places at which a copy is disturbed, for each kind of fault. NODAL_OFFLOAD_PLACES: another number.
int places() {
  const char* const given = std::getenv("NODAL_OFFLOAD_PLACES");
  return given ? std::max(1, std::atoi(given)) : 10;
}

/// One rig for all tests, with one take of files of several MiB.
class Offload : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    rig_ = new Rig;
    rig_->record(450);
    rig_->wire = std::make_unique<FaultyWire>((rig_->folder.path / "wire").string(), rig_->folder.socket());
  }
  static void TearDownTestSuite() { delete rig_; }

  struct Rig {
    RigFolder folder;
    std::unique_ptr<Process> daemon;
    std::unique_ptr<FaultyWire> wire;
    std::uint64_t takes = 0;

    Rig() {
      std::ofstream(folder.config(), std::ios::app) << "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n";
      const Finished fast = Process({"sed", "-i", "s/^calibration = .*/&\\nclock = \"fast\"/", folder.config()}).wait();
      EXPECT_EQ(fast.code, 0);
      start();
    }
    void start() { daemon = std::make_unique<Process>(nodald({"--config", folder.config()})); }
    /// Records a take of at least so many sets.
    void record(std::uint64_t sets) {
      const auto host = LinkHost::connect(folder.socket());
      ASSERT_TRUE(host) << daemon->complained();
      const auto truth = test::read_bytes(folder.path / "truth.json");
      ASSERT_TRUE(host->upload_and_commit(std::string(truth.begin(), truth.end())));
      const auto status = [&] { return host->status().value_or(wire::RigStatus()); };
      ASSERT_TRUE(test::wait_until([&] { return host->pump() && status().raymaps() > 0; }));
      wire::Request start;
      start.mutable_take_start();
      ASSERT_TRUE(host->ask(start)->has_take());
      ASSERT_TRUE(test::wait_until([&] { return host->pump() && status().recording().sets() >= sets; }));
      wire::Request stop;
      stop.mutable_take_stop();
      const auto stopped = host->ask(stop);
      ASSERT_TRUE(stopped && stopped->has_take());
      takes = stopped->take().take();
    }
    fs::path take(std::uint64_t number) const { return folder.path / "takes" / take::take_folder(number); }
  };

  static std::vector<std::string> command(const std::string& socket, std::vector<std::string> arguments) {
    std::vector<std::string> all{NODAL_BIN_DIR "/nodal", "--rig", "unix:" + socket, "--json", "offload"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return all;
  }
  static std::string wire() { return (rig_->folder.path / "wire").string(); }
  static Finished offload(std::vector<std::string> arguments) {
    return Process(command(wire(), std::move(arguments))).wait();
  }
  static Json document(const Finished& done) {
    return Json::parse(done.out.empty() ? "{}" : done.out.substr(0, done.out.find('\n')));
  }

  /// Every file of the rig's folder is in the copy with the same bytes, and nothing else is.
  static void expect_equal(const fs::path& copy, std::uint64_t take = 1) {
    std::size_t files = 0;
    for (const auto& entry : fs::directory_iterator(rig_->take(take))) {
      const std::string name = entry.path().filename().string();
      if (name == take::kProtectedFile) continue;
      ++files;
      EXPECT_TRUE(test::read_bytes(entry.path()) == test::read_bytes(copy / name)) << name;
    }
    EXPECT_GE(files, 10U);
    EXPECT_EQ(std::distance(fs::directory_iterator(copy), fs::directory_iterator()),
              static_cast<std::ptrdiff_t>(files));
  }

  static Rig* rig_;
  const test::TemporaryFolder to_;
};
Offload::Rig* Offload::rig_ = nullptr;

TEST_F(Offload, Undisturbed_GivesTheSameBytesAndFetchesThemOnce) {
  const Finished done = offload({"--new", "--to", to_.path().string()});
  ASSERT_EQ(done.code, 0) << done.err;
  expect_equal(to_ / "000001");
  const Json take = document(done)["takes"][0];
  EXPECT_EQ(take["take"], 1);
  EXPECT_EQ(take["fetched"], take["bytes"]);
  EXPECT_EQ(Process({NODAL_BIN_DIR "/nodal", "take", "verify", (to_ / "000001").string()}).wait().code, 0);
  const Finished again = offload({"1", "--to", to_.path().string()});
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(document(again)["takes"][0]["fetched"], 0);
}

TEST_F(Offload, TheLinkEndsAnywhere_TheSameCommandGoesOnAndGivesTheSameBytes) {
  const Finished whole = offload({"1", "--to", (to_ / "whole").string()});
  ASSERT_EQ(whole.code, 0) << whole.err;
  const std::uint64_t bytes = rig_->wire->passed();
  std::uint64_t saved = 0, least = 0;
  for (int k = 0; k < places(); ++k) {
    SCOPED_TRACE("place " + std::to_string(k));
    const std::string to = (to_ / std::to_string(k)).string();
    const std::uint64_t at = bytes * static_cast<std::uint64_t>(k) / static_cast<std::uint64_t>(places());
    rig_->wire->cut_at(1 + at);
    // The pieces of 1 MiB that the cut leaves incomplete: one that is being received, and one on its way.
    least += at - std::min<std::uint64_t>(at, 2U << 20);
    const Finished cut = offload({"1", "--to", to});
    ASSERT_EQ(cut.code, 3) << cut.err;
    EXPECT_FALSE(fs::exists(fs::path(to) / "000001" / take::kManifestFile));
    const Finished done = offload({"1", "--to", to});
    ASSERT_EQ(done.code, 0) << done.err;
    expect_equal(fs::path(to) / "000001");
    const Json take = document(done)["takes"][0];
    saved += take["bytes"].get<std::uint64_t>() - take["fetched"].get<std::uint64_t>();
    fs::remove_all(to);
  }
  EXPECT_GE(saved, least);
}

TEST_F(Offload, AByteChangesOnTheWay_ItIsNoticedAndTheSameCommandMendsIt) {
  const Finished whole = offload({"1", "--to", (to_ / "whole").string()});
  ASSERT_EQ(whole.code, 0) << whole.err;
  const std::uint64_t bytes = rig_->wire->passed();
  for (int k = 0; k < places(); ++k) {
    SCOPED_TRACE("place " + std::to_string(k));
    const std::string to = (to_ / std::to_string(k)).string();
    rig_->wire->flip_at(bytes * static_cast<std::uint64_t>(k) / static_cast<std::uint64_t>(places()));
    const Finished flipped = offload({"1", "--to", to});
    EXPECT_NE(flipped.code, 0);
    EXPECT_FALSE(fs::exists(fs::path(to) / "000001" / take::kManifestFile));
    const Finished done = offload({"1", "--to", to});
    ASSERT_EQ(done.code, 0) << done.err;
    expect_equal(fs::path(to) / "000001");
    fs::remove_all(to);
  }
}

TEST_F(Offload, KilledAgainAndAgain_EndsWithTheSameBytes) {
  const std::string to = to_.path().string();
  const auto bytes_in = [&](const fs::path& folder) {
    std::uint64_t sum = 0;
    std::error_code gone;
    for (const auto& entry : fs::directory_iterator(folder, gone)) sum += fs::file_size(entry.path(), gone);
    return sum;
  };
  const std::uint64_t whole = bytes_in(rig_->take(1));
  int killed = 0;
  for (int k = 0; k < places(); ++k) {
    Process running(command(wire(), {"1", "--to", to}));
    const std::uint64_t at = whole * static_cast<std::uint64_t>(k) / static_cast<std::uint64_t>(places());
    EXPECT_TRUE(test::wait_until([&] { return bytes_in(to_ / "000001") >= at; }));
    running.signal(SIGKILL);
    if (running.wait().code == 128 + SIGKILL) {
      ++killed;
    } else {  // it was faster
      expect_equal(to_ / "000001");
      fs::remove_all(to_ / "000001");
    }
  }
  EXPECT_GT(killed, places() / 4);
  const Finished done = offload({"1", "--to", to});
  ASSERT_EQ(done.code, 0) << done.err;
  expect_equal(to_ / "000001");
}

TEST_F(Offload, WhatAnEarlierCopyLeftIsDamaged_OnlyThatIsFetchedAgain) {
  ASSERT_EQ(offload({"1", "--to", to_.path().string()}).code, 0);
  const fs::path folder = to_ / "000001", file = folder / "cam3-0000.mkv";
  auto bytes = test::read_bytes(file);
  const std::size_t size = bytes.size();
  ASSERT_GT(size, 2U << 20);
  bytes[(1 << 20) + 17] ^= 1;
  bytes.resize(size + 100, 7);
  fs::remove(file);
  fs::rename(folder / take::kManifestFile, folder / (take::kManifestFile + ".part"));
  test::write_bytes(folder / "cam3-0000.mkv.part", bytes);
  const Finished done = offload({"1", "--to", to_.path().string()});
  ASSERT_EQ(done.code, 0) << done.err;
  EXPECT_EQ(document(done)["takes"][0]["fetched"].get<std::size_t>(), size - (1U << 20));
  expect_equal(folder);
}

TEST_F(Offload, TheRigsDiskIsDamaged_NamesTheFileAndDeletesNothing) {
  rig_->record(100);
  const std::uint64_t take = rig_->takes;
  const fs::path file = rig_->take(take) / "cam2-0000.mkv";
  const auto good = test::read_bytes(file);
  auto bad = good;
  bad[bad.size() / 3] ^= 4;
  test::write_bytes(file, bad);
  const Finished done = offload({std::to_string(take), "--to", to_.path().string(), "--delete"});
  EXPECT_EQ(done.code, 4) << done.err;
  EXPECT_NE(done.err.find("cam2-0000.mkv: what the rig sends from byte 0 on differs"), std::string::npos) << done.err;
  EXPECT_TRUE(fs::exists(rig_->take(take) / take::kManifestFile));
  test::write_bytes(file, good);
  const Finished mended = offload({std::to_string(take), "--to", to_.path().string(), "--delete"});
  EXPECT_EQ(mended.code, 0) << mended.err;
  EXPECT_FALSE(fs::exists(rig_->take(take)));
  EXPECT_EQ(Process({NODAL_BIN_DIR "/nodal", "take", "verify", (to_ / take::take_folder(take)).string()}).wait().code,
            0);
}

TEST_F(Offload, TheFolderHasAnotherTakeOfThisNumber_IsLeftAsItIs) {
  fs::create_directories(to_ / "000001");
  test::write_bytes(to_ / "000001/manifest", {'x'});
  const Finished done = offload({"1", "--to", to_.path().string()});
  EXPECT_EQ(done.code, 7) << done.err;
  EXPECT_NE(done.err.find("holds another take with this number"), std::string::npos) << done.err;
  EXPECT_EQ(test::read_bytes(to_ / "000001/manifest"), std::vector<std::uint8_t>{'x'});
}

TEST_F(Offload, WhatExistsInTheFolder_IsNeverWrittenOver) {
  const std::vector<std::uint8_t> mine{'m', 'i', 'n', 'e'};
  for (const std::string name : {"cam0-0000.mkv", "take.json", "evidence-0000", "cam1-0000.mkv.part"}) {
    SCOPED_TRACE(name);
    const fs::path to = to_ / ("with " + name), folder = to / "000001";
    fs::create_directories(folder);
    test::write_bytes(folder / name, mine);
    test::write_bytes(folder / "notes.txt", mine);
    const Finished refused = offload({"1", "--to", to.string()});
    EXPECT_EQ(refused.code, 7) << refused.err;
    EXPECT_NE(refused.err.find(name + ": is there already"), std::string::npos) << refused.err;
    EXPECT_EQ(test::read_bytes(folder / name), mine);
    EXPECT_FALSE(fs::exists(folder / take::kManifestFile));
    fs::rename(folder / name, folder / "moved away");
    EXPECT_EQ(offload({"1", "--to", to.string()}).code, 0);
    EXPECT_EQ(test::read_bytes(folder / "moved away"), mine);
  }
}

TEST_F(Offload, AFileOfACopyWasChanged_ItStaysAsItIsAndIsNamed) {
  ASSERT_EQ(offload({"1", "--to", to_.path().string()}).code, 0);
  const fs::path folder = to_ / "000001";
  fs::rename(folder / take::kManifestFile, folder / (take::kManifestFile + ".part"));
  for (const std::string name : {"evidence-0000", "cam3-0000.mkv"}) {
    SCOPED_TRACE(name);
    const auto good = test::read_bytes(folder / name);
    auto changed = good;
    changed[changed.size() / 2] ^= 1;
    if (name.starts_with("cam")) changed.pop_back();
    test::write_bytes(folder / name, changed);
    const Finished refused = offload({"1", "--to", to_.path().string()});
    EXPECT_EQ(refused.code, 7) << refused.err;
    EXPECT_NE(refused.err.find(name + ": is "), std::string::npos) << refused.err;
    EXPECT_EQ(test::read_bytes(folder / name), changed);
    test::write_bytes(folder / name, good);
  }
  EXPECT_EQ(offload({"1", "--to", to_.path().string()}).code, 0);
  expect_equal(folder);
}

TEST_F(Offload, AnotherCopiesToTheFolder_IsRefusedAndNothingIsWritten) {
  const fs::path folder = to_ / "000001";
  fs::create_directories(folder);
  const int other = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  ASSERT_EQ(::flock(other, LOCK_EX | LOCK_NB), 0);
  const Finished refused = offload({"1", "--to", to_.path().string()});
  EXPECT_NE(refused.code, 0);
  EXPECT_NE(refused.err.find("another nodal copies to it"), std::string::npos) << refused.err;
  EXPECT_TRUE(fs::is_empty(folder));
  ::close(other);
  EXPECT_EQ(offload({"1", "--to", to_.path().string()}).code, 0);
}

TEST_F(Offload, TheRigDeletedASegmentToMakeRoom_CopiesFromBeforeStayGood) {
  rig_->record(1950);  // two segments
  const std::uint64_t take = rig_->takes;
  const std::string number = std::to_string(take), folder = take::take_folder(take);
  ASSERT_TRUE(fs::exists(rig_->take(take) / "evidence-0001"));
  ASSERT_EQ(offload({number, "--to", (to_ / "whole").string()}).code, 0);
  rig_->wire->cut_at(rig_->wire->passed() / 2);
  ASSERT_EQ(offload({number, "--to", (to_ / "part").string()}).code, 3);

  const auto disk = hal::linux_os::LinuxDisk::open((rig_->folder.path / "takes").string());
  ASSERT_TRUE(disk) << disk.error().text();
  const auto trimmed = firmware::trim_take(**disk, folder);
  ASSERT_TRUE(trimmed) << trimmed.error().text();
  ASSERT_TRUE(trimmed->has_value());
  EXPECT_FALSE(fs::exists(rig_->take(take) / "evidence-0000"));

  const Finished whole_copy = offload({number, "--to", (to_ / "whole").string()});
  ASSERT_EQ(whole_copy.code, 0) << whole_copy.err;
  EXPECT_EQ(document(whole_copy)["takes"][0]["fetched"], 0);
  EXPECT_TRUE(fs::exists(to_ / "whole" / folder / "evidence-0000")) << "the copy keeps what the rig has no more";
  for (const std::string part : {"part", "new"}) {
    SCOPED_TRACE(part);
    const Finished done = offload({number, "--to", (to_ / part).string()});
    ASSERT_EQ(done.code, 0) << done.err;
    const std::string copy = (to_ / part / folder).string();
    EXPECT_EQ(Process({NODAL_BIN_DIR "/nodal", "take", "verify", copy}).wait().code, 0);
    const Finished shown = Process({NODAL_BIN_DIR "/nodal", "--json", "take", "show", copy}).wait();
    ASSERT_EQ(shown.code, 0) << shown.err;
    const Json json = Json::parse(shown.out);
    EXPECT_EQ(json["sets"], (*trimmed)->manifest.sets);
    EXPECT_EQ(json["deleted_sets"], (*trimmed)->manifest.deleted_sets);
    EXPECT_EQ(json["heads"][0]["pictures"], (*trimmed)->manifest.sets);
  }
  expect_equal(to_ / "new" / folder, take);
}

TEST_F(Offload, TheListAsJson_HasWhatOscListsOfFiles) {
  const Finished listed =
      Process({NODAL_BIN_DIR "/nodal", "--rig", "unix:" + rig_->folder.socket(), "--json", "take", "list"}).wait();
  ASSERT_EQ(listed.code, 0) << listed.err;
  const Json take = Json::parse(listed.out)["takes"][0];
  const auto text = test::read_bytes(rig_->take(1) / take::kTakeFile);
  const Json about = Json::parse(std::string(text.begin(), text.end()));
  EXPECT_EQ(take["name"], "000001");
  EXPECT_EQ(take["width"], about["raymap"][0]);
  EXPECT_EQ(take["height"], about["raymap"][1]);
  const std::string seconds = std::to_string(about["started_utc_ns"].get<std::int64_t>() / 1'000'000'000);
  const Finished date = Process({"date", "-u", "-d", "@" + seconds, "+%Y:%m:%d %H:%M:%S+00:00"}).wait();
  EXPECT_EQ(take["date_time_zone"].get<std::string>() + "\n", date.out);
  std::uint64_t bytes = 0;
  for (const auto& entry : fs::directory_iterator(rig_->take(1)))
    bytes += entry.path().filename() == take::kManifestFile ? 0 : entry.file_size();
  EXPECT_EQ(take["bytes"], bytes);
}

TEST_F(Offload, OnlyTheRaymaps_LeavesTheHeadsOnTheRig) {
  const Finished done = offload({"1", "--to", to_.path().string(), "--only", "raymap"});
  ASSERT_EQ(done.code, 0) << done.err;
  EXPECT_TRUE(test::read_bytes(to_ / "000001/raymap-0000.mkv") == test::read_bytes(rig_->take(1) / "raymap-0000.mkv"));
  EXPECT_FALSE(fs::exists(to_ / "000001/cam0-0000.mkv"));
  const Finished judged = Process({NODAL_BIN_DIR "/nodal", "take", "verify", (to_ / "000001").string()}).wait();
  EXPECT_EQ(judged.code, 7);
  EXPECT_NE(judged.err.find("the copy is not complete"), std::string::npos) << judged.err;
  EXPECT_EQ(offload({"1", "--to", to_.path().string(), "--only", "raymap", "--delete"}).code, 2);
  ASSERT_EQ(offload({"1", "--to", to_.path().string()}).code, 0);
  expect_equal(to_ / "000001");
}

TEST_F(Offload, ATakeThatIsNotThereOrNotFinished_IsRefusedByItsNumber) {
  const Finished missing = offload({"77", "--to", to_.path().string()});
  EXPECT_NE(missing.code, 0);
  EXPECT_NE(missing.err.find("there is no take 77"), std::string::npos) << missing.err;
  EXPECT_EQ(offload({"--to", to_.path().string()}).code, 2);
  const auto host = LinkHost::connect(rig_->folder.socket());
  ASSERT_TRUE(host);
  wire::Request start;
  start.mutable_take_start();
  const auto started = host->ask(start);
  ASSERT_TRUE(started && started->has_take());
  const Finished early = offload({std::to_string(started->take().take()), "--to", to_.path().string()});
  EXPECT_EQ(early.code, 7);
  EXPECT_NE(early.err.find("is not finished"), std::string::npos) << early.err;
  wire::Request stop;
  stop.mutable_take_stop();
  EXPECT_TRUE(host->ask(stop)->has_take());
}

}  // namespace
}  // namespace nodal::crash
