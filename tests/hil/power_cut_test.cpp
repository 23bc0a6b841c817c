// Takes on real file systems whose power fails. A take is recorded on a disk that logs every write. Then, for many
// places in that log, the disk is made as a power cut there leaves it, mounted and recovered as at nodald's start. Runs
// in the guest; NODAL_POWER_CUTS is the number of places on each file system.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <ostream>
#include <random>

#include "hal/linux/disk.h"
#include "logged_disk.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"
#include "tests/support/process.h"
#include "tests/support/take_stage.h"

namespace nodal::firmware {
namespace {

using Bytes = std::vector<std::uint8_t>;

struct FileSystem {
  std::string type;
  std::vector<std::string> make;
};
void PrintTo(const FileSystem& system, std::ostream* out) { *out << system.type; }

/// 30 pictures a second of each head: 0.4 MB/s.
TakeStage::Options options() {
  TakeStage::Options options;
  options.rate = {30, 1};
  options.width = 96;
  options.height = 72;
  return options;
}
constexpr std::uint64_t kSetsASecond = 30;

std::uint64_t places() {
  const char* wanted = std::getenv("NODAL_POWER_CUTS");
  return wanted ? std::strtoull(wanted, nullptr, 10) : 7;
}

/// Whether every picture in a file of a head is that of its set. The pictures' first bytes are the set's number.
void expect_right_pictures(const Bytes& video, const take::Segment& segment, int file) {
  std::size_t right = 0;
  for (const take::wire::Set& set : segment.sets) {
    const take::wire::Frame& frame = set.frames(file);
    ASSERT_LE(frame.at() + frame.bytes(), video.size());
    ASSERT_EQ(frame.bytes(), 96U * 72U);
    std::uint64_t number = 0;
    for (std::size_t k = 0; k < 8; ++k) number |= std::uint64_t{video[frame.at() + k]} << (8 * k);
    const auto rest = video.begin() + static_cast<std::ptrdiff_t>(frame.at());
    const bool whole = std::all_of(rest + 8, rest + 96 * 72, [](std::uint8_t byte) { return byte == 90; });
    right += number == set.number() && whole ? 1U : 0U;
  }
  EXPECT_EQ(right, segment.sets.size());
}

/// Checks all files of the take against its manifest, its evidence and ffprobe.
void check_take(hal::DiskPort& disk, const std::string& mounted, std::uint64_t sets) {
  const std::string folder = take::take_folder(1);
  const auto read = [&](const std::string& name) {
    return disk.read(folder + "/" + name, std::uint64_t{1} << 28).value_or(Bytes());
  };
  const Bytes text = read(take::kManifestFile);
  const auto manifest = take::parse_manifest({reinterpret_cast<const char*>(text.data()), text.size()}, "manifest");
  ASSERT_TRUE(manifest) << manifest.error().text();
  EXPECT_EQ(manifest->sets, sets);
  std::uint64_t found = 0;
  for (const take::Manifest::File& file : manifest->files) {
    const Bytes bytes = read(file.name);
    EXPECT_EQ(bytes.size(), file.bytes) << file.name;
    take::PieceHashes hashes;
    hashes.update(bytes);
    EXPECT_EQ(take::digest_of(hashes.all()), file.digest) << file.name;
    if (!file.name.starts_with("evidence")) continue;
    const auto segment = take::read_evidence(bytes, file.name);
    ASSERT_TRUE(segment && segment->end) << file.name;
    found += segment->sets.size();
    for (int k = 0; k < segment->begin.files_size(); ++k) {
      const std::string& name = segment->begin.files(k).name();
      expect_right_pictures(read(name), *segment, k);
      const test::Finished probed =
          test::Process({"ffprobe", "-v", "error", "-count_packets", "-show_entries", "stream=nb_read_packets", "-of",
                         "default=nk=1:nw=1", mounted + "/" + folder + "/" + name})
              .wait();
      EXPECT_EQ(probed.out, std::to_string(segment->sets.size()) + "\n") << name << ": " << probed.err;
    }
  }
  EXPECT_EQ(found, sets);
}

class PowerCuts : public testing::TestWithParam<FileSystem> {};

TEST_P(PowerCuts, AnywhereInATakeOfTwoSegments_LoseAtMostASecondAndEveryFileIsWhole) {
  const std::string scratch = "/run/" + GetParam().type;
  hil::LoggedDisk disk(scratch, GetParam().make, GetParam().type, 320);
  std::optional<hil::WriteLog> log;
  {
    const std::string mounted = disk.begin_log();
    const auto takes = hal::linux_os::LinuxDisk::open(mounted);
    ASSERT_TRUE(takes) << takes.error().text();
    hal::sim::SimClock clock;
    TakeStage stage(**takes, clock, options());
    const TakeAnswer started = stage.start();
    ASSERT_TRUE(started.result) << started.result.error().text();
    const std::uint64_t before = stage.offered();
    for (int k = 0; k < 640; ++k) {
      stage.run(Duration::milliseconds(100));
      disk.mark(std::to_string(stage.offered() - before));
    }
    EXPECT_TRUE(stage.problems().empty()) << stage.problems().front();
  }
  log = disk.end_log();
  ASSERT_TRUE(log);
  ASSERT_GT(log->flushes(), 128U) << "two syncs a second";

  std::mt19937_64 random(7);
  std::uint64_t most_lost = 0, fewest = ~std::uint64_t{0}, most = 0;
  for (std::uint64_t place = 0; place < places(); ++place) {
    const std::size_t cut = 1 + static_cast<std::size_t>(random() % log->size());
    const std::string& mark = log->mark_before(cut);
    const std::uint64_t offered = mark.empty() ? 0 : std::stoull(mark);
    SCOPED_TRACE("cut after write " + std::to_string(cut) + " of " + std::to_string(log->size()) + ", place " +
                 std::to_string(place) + ", " + std::to_string(offered) + " sets offered");
    const auto mounted = disk.mount_after_cut(*log, cut, place);
    if (!mounted) continue;
    {
      const auto takes = hal::linux_os::LinuxDisk::open(*mounted);
      ASSERT_TRUE(takes) << takes.error().text();
      hal::sim::SimClock clock;
      TakeStage stage(**takes, clock, options());
      const std::vector<TakeEntry> list = stage.list();
      ASSERT_LE(list.size(), 1U);
      std::uint64_t sets = 0;
      if (!list.empty()) {
        EXPECT_EQ(list[0].state, TakeState::kComplete) << list[0].problem;
        sets = list[0].sets;
        check_take(**takes, *mounted, sets);
      }
      EXPECT_GE(sets + kSetsASecond, offered) << "more than a second is lost";
      most_lost = std::max(most_lost, offered - std::min(offered, sets));
      fewest = std::min(fewest, sets);
      most = std::max(most, sets);
    }
    disk.unmount();
    if (HasFatalFailure()) return;
  }
  std::ofstream("power_cuts.txt", std::ios::app)
      << GetParam().type << ": " << places() << " power cuts in " << log->size() << " writes with " << log->flushes()
      << " flushes; takes of " << fewest << " to " << most << " sets, at most " << most_lost << " sets lost\n";
}

INSTANTIATE_TEST_SUITE_P(All, PowerCuts,
                         testing::Values(FileSystem{"ext4", {"mkfs.ext4", "-q"}},
                                         FileSystem{"f2fs", {"mkfs.f2fs", "-q"}}, FileSystem{"exfat", {"mkfs.exfat"}}),
                         [](const auto& system) { return system.param.type; });

}  // namespace
}  // namespace nodal::firmware
