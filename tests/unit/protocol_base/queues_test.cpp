#include <gtest/gtest.h>

#include <memory>
#include <thread>

#include "protocol/base/bounded_queue.h"
#include "protocol/base/spsc_ring.h"

namespace nodal {
namespace {

template <class Queue>
class Queues : public testing::Test {};
using Both = testing::Types<BoundedQueue<std::shared_ptr<int>>, SpscRing<std::shared_ptr<int>>>;
TYPED_TEST_SUITE(Queues, Both);

TYPED_TEST(Queues, Full_PushSaysSoAndTheValueStaysWithTheCaller) {
  TypeParam queue(2);
  EXPECT_TRUE(queue.push(std::make_shared<int>(1)));
  EXPECT_TRUE(queue.push(std::make_shared<int>(2)));
  auto third = std::make_shared<int>(3);
  EXPECT_TRUE(queue.full());
  EXPECT_FALSE(queue.push(std::move(third)));
  ASSERT_NE(third, nullptr);
  EXPECT_EQ(*third, 3);
}

TYPED_TEST(Queues, AroundTheEndManyTimes_OrderIsKept) {
  TypeParam queue(3);
  int in = 0, out = 0;
  for (int round = 0; round < 100; ++round) {
    for (int i = 0; i <= round % 3; ++i) ASSERT_TRUE(queue.push(std::make_shared<int>(in++)));
    for (auto value = queue.pop(); value; value = queue.pop()) ASSERT_EQ(**value, out++);
  }
  EXPECT_EQ(in, out);
  EXPECT_TRUE(queue.empty());
}

TYPED_TEST(Queues, Popped_NothingOfItStaysInside) {
  TypeParam queue(4);
  auto value = std::make_shared<int>(1);
  ASSERT_TRUE(queue.push(std::shared_ptr<int>(value)));
  queue.pop().reset();
  EXPECT_EQ(value.use_count(), 1);
}

TEST(BoundedQueue, Cleared_EmptyAndLetsGoOfAll) {
  BoundedQueue<std::shared_ptr<int>> queue(4);
  auto value = std::make_shared<int>(1);
  queue.push(value);
  queue.push(value);
  queue.clear();
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(value.use_count(), 1);
}

// This test is most useful when built with the thread sanitizer.
TEST(SpscRing, TwoThreads_EveryValueArrivesOnceInOrder) {
  constexpr int kValues = 20'000;  // on a busy machine every seventh value waits for the other thread to be scheduled
  SpscRing<std::unique_ptr<int>> ring(7);
  std::thread writer([&] {
    for (int i = 0; i < kValues;) {
      if (ring.push(std::make_unique<int>(i))) {
        ++i;
      } else {
        std::this_thread::yield();
      }
    }
  });
  int due = 0;
  bool in_order = true;
  while (due < kValues) {
    if (auto value = ring.pop()) {
      in_order = in_order && **value == due;
      ++due;
    } else {
      std::this_thread::yield();
    }
  }
  writer.join();
  EXPECT_TRUE(in_order);
  EXPECT_TRUE(ring.empty());
}

}  // namespace
}  // namespace nodal
