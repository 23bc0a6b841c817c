// Films in many parts, and kills at any moment: the same bytes from every encoder. Takes long.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <random>
#include <thread>

#include "film_command.h"

namespace nodal::command_line {
namespace {

class FilmKills : public FilmCommand, public testing::WithParamInterface<const char*> {};

TEST_P(FilmKills, SevenShardsInAnyOrderAndTwentyKills_SameBytes) {
  constexpr int kSegments = 7, kKills = 20;
  write_films((kSegments - 1) * 240 + 60, ".mp4", kH264);
  Words how{"--width", "128", "--codec", GetParam(), "--seams", "fixed"};
  if (GetParam() != std::string("ffv1")) how.insert(how.end(), {"--preset", "ultrafast"});
  const auto with = [&](const Words& more) {
    Words words = how;
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  const auto begin = std::chrono::steady_clock::now();
  expect_good(stitch("one.mkv", how));
  const auto whole = std::chrono::steady_clock::now() - begin;
  const std::string one = read("one.mkv");
  ASSERT_GT(one.size(), 100'000u);

  std::mt19937 random(7);
  std::vector<int> order;
  for (int k = 0; k < kSegments; ++k) order.push_back(k);
  std::ranges::shuffle(order, random);
  for (const int k : order) expect_good(stitch("shards.mkv", with({"--segments", std::to_string(k)})));
  expect_good(stitch("shards.mkv", with({"--join"})));
  EXPECT_TRUE(read("shards.mkv") == one) << "seven shards";

  // From a run that has hardly begun to one that may have finished a segment.
  std::uniform_real_distribution<double> part(0, 1.5 / kSegments);
  int kills = 0;
  for (; kills < kKills && !std::filesystem::exists(path("kill.mkv")); ++kills) {
    const auto run = start(stitch("kill.mkv", how));
    std::this_thread::sleep_for(part(random) * whole);
    run->signal(SIGKILL);
    run->wait();
  }
  EXPECT_GE(kills, kSegments) << "of a run that was killed this often, little can have been kept";
  if (!std::filesystem::exists(path("kill.mkv"))) expect_good(stitch("kill.mkv", how));
  EXPECT_TRUE(read("kill.mkv") == one) << "killed " << kills << " times";
  EXPECT_TRUE(parts("kill.mkv").empty());
}

INSTANTIATE_TEST_SUITE_P(Encoders, FilmKills, testing::Values("h264", "h265", "ffv1"),
                         [](const auto& encoder) { return std::string(encoder.param); });

}  // namespace
}  // namespace nodal::command_line
