#include "protocol/base/loan.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <thread>
#include <vector>

#include "protocol/base/spsc_ring.h"

namespace nodal {
namespace {

TEST(Loan, LastOfSeveralHoldersGivesUp_ThePoolLendsTheValueAgain) {
  std::vector<int> returned;
  LoanPool<int> pool(1, [&](int& value) { returned.push_back(value); });
  Loan<int> first = pool.take();
  ASSERT_TRUE(first);
  first.edit() = 7;
  Loan<int> second = first;
  EXPECT_FALSE(pool.take()) << "everything is lent";
  first = {};
  EXPECT_FALSE(pool.collect());
  EXPECT_EQ(*second, 7);
  second = {};
  EXPECT_TRUE(pool.collect());
  EXPECT_EQ(returned, std::vector<int>{7});
  EXPECT_EQ(pool.lent(), 0u);
  EXPECT_EQ(*pool.take(), 7) << "as its last holder left it";
}

TEST(Loan, MoreThanThePoolHolds_AnEmptyLoanAndNoMoreMemory) {
  LoanPool<int> pool(3);
  std::vector<Loan<int>> held;
  for (int i = 0; i < 3; ++i) held.push_back(pool.take());
  for (const auto& loan : held) EXPECT_TRUE(loan);
  EXPECT_FALSE(pool.take());
  EXPECT_EQ(pool.lent(), 3u);
}

TEST(LoanDeathTest, WritingWithASecondHolder_IsAProgrammersError) {
  LoanPool<int> pool(1);
  const Loan<int> first = pool.take();
  const Loan<int> second = first;
  EXPECT_DEATH(first.edit() = 1, "holders");
}

// Four threads hold the same values; each value that is returned has been read completely by all of them.
TEST(Loan, HoldersOnFourThreads_NoValueComesBackWhileAnyOfThemReads) {
  constexpr int kThreads = 4;
  constexpr std::uint64_t kValues = 2000;
  std::atomic<std::uint64_t> wrong{0};
  std::uint64_t returned = 0;
  LoanPool<std::vector<std::uint64_t>> pool(3, [&](std::vector<std::uint64_t>&) { ++returned; });
  std::array<SpscRing<Loan<std::vector<std::uint64_t>>>, kThreads> rings{
      SpscRing<Loan<std::vector<std::uint64_t>>>(2), SpscRing<Loan<std::vector<std::uint64_t>>>(2),
      SpscRing<Loan<std::vector<std::uint64_t>>>(2), SpscRing<Loan<std::vector<std::uint64_t>>>(2)};
  std::atomic<bool> stop{false};
  std::vector<std::thread> readers;
  for (auto& ring : rings) {
    readers.emplace_back([&] {
      while (!stop.load()) {
        const auto loan = ring.pop();
        if (!loan) {
          std::this_thread::yield();
          continue;
        }
        const std::uint64_t front = (*loan)->front();
        for (const std::uint64_t value : **loan) wrong += value != front;
      }
    });
  }
  for (std::uint64_t i = 0; i < kValues;) {
    Loan<std::vector<std::uint64_t>> loan = pool.take();
    if (!loan) {
      std::this_thread::yield();
      continue;
    }
    loan.edit().assign(256, i++);
    for (auto& ring : rings) {
      Loan<std::vector<std::uint64_t>> copy = loan;
      (void)ring.push(std::move(copy));
    }
  }
  stop.store(true);
  for (std::thread& reader : readers) reader.join();
  for (auto& ring : rings) {
    while (ring.pop()) {}
  }
  pool.collect();
  EXPECT_EQ(wrong.load(), 0u);
  EXPECT_EQ(returned, kValues);
}

}  // namespace
}  // namespace nodal
