// What every OutputPinPort and InputPinPort must hold. An implementation takes part by a world that can look at the
// wire from outside.
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <ostream>
#include <thread>

#include "hal/pin.h"
#include "hal/sim/clock.h"
#include "hal/sim/pin.h"

namespace nodal::hal {

namespace {

class PinWorld {
 public:
  virtual ~PinWorld() = default;
  virtual OutputPinPort& output() = 0;
  virtual bool safe_level() const = 0;
  /// The output's level, measured outside the port.
  virtual bool output_wire() = 0;
  virtual InputPinPort& input() = 0;
  /// Somebody else drives the input, which began low.
  virtual void drive_input(bool high) = 0;
  virtual Instant now() = 0;
  virtual void pass(Duration time) = 0;
};

struct PinWorldKind {
  std::string name;
  std::function<std::unique_ptr<PinWorld>()> make;
  friend std::ostream& operator<<(std::ostream& out, const PinWorldKind& kind) { return out << kind.name; }
};

class PinConformance : public testing::TestWithParam<PinWorldKind> {
 protected:
  std::unique_ptr<PinWorld> world_ = GetParam().make();
};

constexpr Duration kLease = Duration::milliseconds(50);

TEST_P(PinConformance, OutputNeverSet_IsAtItsSafeLevel) { EXPECT_EQ(world_->output_wire(), world_->safe_level()); }

TEST_P(PinConformance, OutputSet_HoldsForItsLeaseThenIsSafe) {
  const bool unsafe = !world_->safe_level();
  ASSERT_TRUE(world_->output().set(unsafe, world_->now(), kLease));
  for (int ms = 0; ms < 40; ms += 5) {
    EXPECT_EQ(world_->output_wire(), unsafe) << ms;
    world_->pass(Duration::milliseconds(5));
    ASSERT_TRUE(world_->output().step(world_->now()));
  }
  world_->pass(kLease);
  ASSERT_TRUE(world_->output().step(world_->now()));
  EXPECT_EQ(world_->output_wire(), world_->safe_level());
}

TEST_P(PinConformance, OutputSetAgainInTime_TheLeaseBeginsAnew) {
  const bool unsafe = !world_->safe_level();
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(world_->output().set(unsafe, world_->now(), kLease));
    world_->pass(kLease / 2);
    ASSERT_TRUE(world_->output().step(world_->now()));
    EXPECT_EQ(world_->output_wire(), unsafe);
  }
}

TEST_P(PinConformance, OutputMadeSafeByAnotherThread_StaysSafeWhateverIsAsked) {
  const bool unsafe = !world_->safe_level();
  ASSERT_TRUE(world_->output().set(unsafe, world_->now(), kLease));
  std::thread another([&] { world_->output().make_safe(); });
  for (int i = 0; i < 1000; ++i) {
    if (const Status set = world_->output().set(unsafe, world_->now(), kLease); !set) {
      EXPECT_EQ(set.error().code, Errc::kDeviceGone);
    }
  }
  another.join();
  EXPECT_EQ(world_->output_wire(), world_->safe_level());
  EXPECT_EQ(world_->output().set(unsafe, world_->now(), kLease).error().code, Errc::kDeviceGone);
  EXPECT_EQ(world_->output_wire(), world_->safe_level());
}

TEST_P(PinConformance, OutputSetBack_IsSafeAtOnce) {
  ASSERT_TRUE(world_->output().set(!world_->safe_level(), world_->now(), kLease));
  ASSERT_TRUE(world_->output().set(world_->safe_level(), world_->now(), kLease));
  EXPECT_EQ(world_->output_wire(), world_->safe_level());
}

TEST_P(PinConformance, OutputLeaseOfNothing_IsABadValueAndChangesNothing) {
  const Status status = world_->output().set(!world_->safe_level(), world_->now(), Duration{});
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kBadValue);
  EXPECT_EQ(world_->output_wire(), world_->safe_level());
}

TEST_P(PinConformance, InputDriven_EveryEdgeComesOnceInOrderOfTime) {
  std::vector<PinEdge> seen;
  for (int i = 0; i < 20; ++i) {
    world_->drive_input(i % 2 == 0);
    world_->pass(Duration::milliseconds(10));
    if (i % 3 != 0) continue;  // edges wait until they are taken
    while (auto edge = world_->input().take_edge().value()) seen.push_back(*edge);
  }
  while (auto edge = world_->input().take_edge().value()) seen.push_back(*edge);
  ASSERT_EQ(seen.size(), 20U);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    EXPECT_EQ(seen[i].high, i % 2 == 0);
    EXPECT_GT(seen[i].at, i > 0 ? seen[i - 1].at : Instant{});
    EXPECT_LE(seen[i].at, world_->now());
  }
}

TEST_P(PinConformance, InputAsked_SaysItsLevelNow) {
  EXPECT_FALSE(world_->input().level().value());
  world_->drive_input(true);
  world_->pass(Duration::milliseconds(10));
  EXPECT_TRUE(world_->input().level().value());
  world_->drive_input(false);
  world_->pass(Duration::milliseconds(10));
  EXPECT_FALSE(world_->input().level().value());
}

class SimPinWorld final : public PinWorld {
 public:
  explicit SimPinWorld(bool safe) : safe_(safe), output_(safe) {}
  OutputPinPort& output() override { return output_; }
  bool safe_level() const override { return safe_; }
  bool output_wire() override { return output_.level_at(clock_.now()); }
  InputPinPort& input() override { return input_; }
  void drive_input(bool high) override { input_.script(clock_.now(), high); }
  Instant now() override { return clock_.now(); }
  void pass(Duration time) override { clock_.advance(time); }

 private:
  const bool safe_;
  sim::SimClock clock_;
  sim::SimOutputPin output_;
  sim::SimInputPin input_{clock_};
};

INSTANTIATE_TEST_SUITE_P(
    All, PinConformance,
    testing::Values(PinWorldKind{"SimSafeLow", [] { return std::make_unique<SimPinWorld>(false); }},
                    PinWorldKind{"SimSafeHigh", [] { return std::make_unique<SimPinWorld>(true); }}),
    [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace nodal::hal
