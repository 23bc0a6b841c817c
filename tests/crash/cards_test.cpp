// A card from a stranger in the real nodald, with the memory of a small board: the rig starts, films, and names what it cannot read.
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <map>

#include "nodald_process.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"
#include "tests/scenario/small_rig.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::crash {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kGiB = std::uint64_t{1} << 30;
constexpr std::uint64_t kAddresses = 512;  // MiB, of nodald with everything it starts

void append(std::vector<std::uint8_t>& to, const std::vector<std::uint8_t>& bytes) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}

take::wire::Record begin_record() {
  take::wire::Record record;
  take::wire::Begin& begin = *record.mutable_begin();
  begin.set_version(1);
  begin.set_take(1);
  take::wire::File& file = *begin.add_files();
  file.set_name("cam0-0000.mkv");
  file.set_head(0);
  file.set_format("MJPEG");
  file.set_width(64);
  file.set_height(64);
  return record;
}

/// 65 kB of evidence that claim one row of 3.9 GiB.
std::vector<std::uint8_t> evidence_of_a_huge_row() {
  constexpr std::uint64_t kPieces = 3990;
  take::EvidenceWriter writer;
  std::vector<std::uint8_t> bytes = writer.encode(begin_record());
  take::wire::Record set;
  set.mutable_set()->add_frames()->set_bytes(kPieces << 20);
  append(bytes, writer.encode(set));
  take::wire::Record clusters;
  clusters.mutable_clusters()->set_sets(1);
  clusters.mutable_clusters()->add_end(kPieces << 20);
  clusters.mutable_clusters()->add_hashes(std::string(kPieces * 16, 'h'));
  append(bytes, writer.encode(clusters));
  return bytes;
}

/// As many raymaps as 64 MiB of evidence can name: 1.8 GiB when they are all kept.
std::vector<std::uint8_t> evidence_of_raymaps() {
  take::EvidenceWriter writer;
  take::wire::Record begin = begin_record();
  begin.mutable_begin()->add_files()->set_name("raymap-0000.mkv");
  begin.mutable_begin()->mutable_files(1)->set_format("MJPEG");
  begin.mutable_begin()->mutable_files(1)->set_width(64);
  begin.mutable_begin()->mutable_files(1)->set_height(64);
  std::vector<std::uint8_t> bytes = writer.encode(begin);
  take::wire::Record clusters;
  for (int k = 0; k < 2; ++k) {
    clusters.mutable_clusters()->add_end(0);
    clusters.mutable_clusters()->add_hashes();
  }
  for (int k = 0; k < 30'000; ++k) clusters.mutable_clusters()->add_raymaps();
  while (bytes.size() + (64 << 10) < take::kMaxEvidenceBytes) append(bytes, writer.encode(clusters));
  return bytes;
}

/// A rig with a foreign card.
struct ForeignCard : RigFolder {
  ForeignCard() {
    std::ofstream(config(), std::ios::app) << "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n";
    make_take(1);
    test::write_bytes(file(1, "evidence-0000"), evidence_of_a_huge_row());
    std::ofstream(file(1, "cam0-0000.mkv")) << "";
    fs::resize_file(file(1, "cam0-0000.mkv"), 4 * kGiB);  // sparse
    make_take(2);
    {
      std::ofstream manifest(file(2, "manifest"));
      for (int k = 0; k < (31 << 20) / 2; ++k) manifest << "{}";
    }
    make_take(3);
    test::write_bytes(file(3, "evidence-0000"), evidence_of_raymaps());
  }
  fs::path file(std::uint64_t take, const std::string& name) const {
    return path / "takes" / take::take_folder(take) / name;
  }
  void make_take(std::uint64_t number) const {
    fs::create_directories(file(number, ""));
    take::TakeDocument about;
    about.number = number;
    about.rig = "another";
    about.software = "another";
    about.rate = {30, 1};
    about.mode = "driver";
    about.heads = {"cam0"};
    std::ofstream(file(number, take::kTakeFile)) << take::take_json(about);
  }
};

struct Seen {
  std::string state, problem;
};

/// Starts nodald with little memory, films a take, and returns what it says about the others.
std::map<std::uint64_t, Seen> film_beside(const ForeignCard& card) {
  std::map<std::uint64_t, Seen> seen;
  std::vector<std::string> command = nodald({"--config", card.config(), "--blend-threads", "2"});
  command.insert(command.begin(), {"prlimit", "--as=" + std::to_string(kAddresses << 20)});
  test::Process daemon(command);
  const auto host = LinkHost::connect(card.socket());
  EXPECT_TRUE(host) << daemon.complained();
  if (!host) return seen;
  wire::Request start, stop, list;
  start.mutable_take_start();
  stop.mutable_take_stop();
  list.mutable_take_list();
  EXPECT_TRUE(host->wait_for([](const wire::RigStatus& status) { return status.full_sets() > 3; }));
  const auto started = host->ask(start);
  EXPECT_TRUE(started && started->has_take()) << (started ? started->error().message() : "no answer");
  EXPECT_TRUE(host->wait_for([](const wire::RigStatus& status) { return status.recording().sets() >= 20; }))
      << daemon.complained();
  EXPECT_TRUE(test::wait_until([&] {
    const auto reply = host->ask(list);
    if (!reply) return true;
    seen.clear();
    for (const wire::TakeEntry& take : reply->takes().takes()) seen[take.number()] = {take.state(), take.problem()};
    return std::ranges::none_of(seen, [](const auto& each) { return each.second.state == "unfinished"; });
  })) << daemon.complained();
  const auto stopped = host->ask(stop);
  EXPECT_TRUE(stopped && stopped->has_take()) << daemon.complained();
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(std::chrono::seconds(60)).code, 0) << daemon.complained();
  return seen;
}

TEST(ForeignCards, WithTheMemoryOfASmallBoard_TheRigFilmsAndNamesWhatItCannotRead) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer needs all addresses";
#endif
  const ForeignCard card;
  for (int start = 1; start <= 3; ++start) {
    SCOPED_TRACE("start " + std::to_string(start));
    std::map<std::uint64_t, Seen> seen = film_beside(card);
    EXPECT_EQ(seen[1].state, "complete") << seen[1].problem;
    EXPECT_EQ(seen[2].state, "damaged");
    EXPECT_NE(seen[2].problem.find("manifest"), std::string::npos) << seen[2].problem;
    EXPECT_EQ(seen[3].state, "complete") << seen[3].problem;  // without the segment whose evidence is refused
    EXPECT_EQ(seen.size(), 3u + static_cast<std::size_t>(start));
  }
  EXPECT_GT(fs::file_size(card.file(3, "evidence-0000")), std::uint64_t{60} << 20) << "nothing of it is deleted";
}

}  // namespace
}  // namespace nodal::crash
