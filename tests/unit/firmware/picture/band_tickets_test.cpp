#include "firmware/picture/band_tickets.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

namespace nodal::firmware {
namespace {

TEST(BandTickets, BeforeTheFirstRound_ThereIsNoBand) {
  BandTickets tickets;
  EXPECT_FALSE(tickets.take());
  EXPECT_TRUE(tickets.all_done());
}

TEST(BandTickets, EachBand_IsTakenOnce) {
  BandTickets tickets;
  for (std::uint64_t round = 0; round < 3; ++round) {
    tickets.start(round + 1);
    for (std::uint64_t band = 0; band <= round; ++band) EXPECT_EQ(tickets.take(), band);
    EXPECT_FALSE(tickets.take());
    for (std::uint64_t band = 0; band <= round; ++band) {
      EXPECT_FALSE(tickets.all_done()) << "a band that is taken is not done";
      tickets.done();
    }
    EXPECT_TRUE(tickets.all_done());
  }
}

TEST(BandTickets, TheLargestRound_IsTakenToItsEnd) {
  BandTickets tickets;
  for (int round = 0; round < 2; ++round) {
    tickets.start(BandTickets::kAllBands);
    std::uint64_t taken = 0;
    for (; tickets.take(); ++taken) tickets.done();
    EXPECT_EQ(taken, BandTickets::kAllBands);
    EXPECT_TRUE(tickets.all_done());
  }
}

/// Bands that cost nothing, so that threads want the same one all the time.
TEST(BandTickets, FourThreadsInALargeRound_NeverTakeTheSameBand) {
  BandTickets tickets;
  std::vector<std::atomic<std::uint32_t>> taken(BandTickets::kAllBands);
  constexpr std::uint32_t kRounds = 5;
  for (std::uint32_t round = 0; round < kRounds; ++round) {
    tickets.start(BandTickets::kAllBands);
    std::vector<std::jthread> threads;
    for (int i = 0; i < 4; ++i) {
      threads.emplace_back([&] {
        while (const auto band = tickets.take()) taken[*band].fetch_add(1, std::memory_order_relaxed);
      });
    }
  }
  for (std::size_t band = 0; band < taken.size(); ++band) ASSERT_EQ(taken[band].load(), kRounds) << band;
}

/// Rounds of different lengths follow one another at once, so that threads hold tickets of rounds that are over.
TEST(BandTickets, FourThreads_DoEachBandOfEachRoundOnceAndSeeWhatWasWrittenBefore) {
  BandTickets tickets;
  constexpr std::uint64_t kRounds = 20'000;
  std::vector<std::uint32_t> done_in(16);  // not atomic: no two threads have the same band
  std::vector<std::uint64_t> numbers(16);
  std::atomic<bool> stop{false};
  std::atomic<std::uint64_t> beyond{0};
  std::uint64_t bands = 0, round = 0;  // written before start()
  std::vector<std::jthread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      while (!stop.load()) {
        const auto band = tickets.take();
        if (!band) {
          std::this_thread::yield();
          continue;
        }
        if (*band >= bands) beyond.fetch_add(1);
        ++done_in[*band % done_in.size()];
        numbers[*band % numbers.size()] = round;
        tickets.done();
      }
    });
  }
  std::vector<std::uint32_t> expected(done_in.size());
  std::uint64_t others = 0;
  for (round = 1; round <= kRounds; ++round) {
    bands = 1 + round * 7 % done_in.size();
    for (std::uint64_t band = 0; band < bands; ++band) ++expected[band];
    tickets.start(bands);
    while (!tickets.all_done()) std::this_thread::yield();
    for (std::uint64_t band = 0; band < bands; ++band) others += numbers[band] != round;
  }
  stop.store(true);
  threads.clear();
  EXPECT_EQ(beyond.load(), 0U);
  EXPECT_EQ(others, 0U) << "numbers that were not those of the round";
  EXPECT_EQ(done_in, expected);
}

}  // namespace
}  // namespace nodal::firmware
