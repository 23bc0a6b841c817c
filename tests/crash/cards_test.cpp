// A card from a stranger in the real nodald, with the memory of a small board: the rig starts, films, and names what it
// cannot read.
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <map>

#include "nodald_process.h"
#include "protocol/take/evidence.h"
#include "tests/scenario/small_rig.h"
#include "tests/support/foreign_takes.h"
#include "tests/support/process.h"

namespace nodal::crash {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kAddresses = 512;  // MiB, of nodald with everything it starts

/// A rig with a foreign card.
struct ForeignCard : RigFolder {
  ForeignCard() {
    std::ofstream(config(), std::ios::app) << "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n";
    test::put_foreign_takes(path / "takes");
  }
  fs::path file(std::uint64_t take, const std::string& name) const {
    return path / "takes" / take::take_folder(take) / name;
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
    EXPECT_EQ(seen[4].state, "complete") << seen[4].problem;
    EXPECT_EQ(seen.size(), test::kForeignTakes + static_cast<std::size_t>(start));
  }
  EXPECT_GT(fs::file_size(card.file(3, "evidence-0000")), std::uint64_t{60} << 20) << "nothing of it is deleted";
}

}  // namespace
}  // namespace nodal::crash
