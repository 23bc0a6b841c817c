#include "firmware/operate/panel.h"

#include <gtest/gtest.h>

#include <string>

#include "hal/sim/clock.h"
#include "hal/sim/pin.h"

namespace nodal::firmware {
namespace {

constexpr Duration ms(std::int64_t n) { return Duration::milliseconds(n); }

class PanelTest : public testing::Test {
 protected:
  /// Presses the button `from` after now, for `length`.
  void press(Duration from, Duration length) {
    button.script(clock.now() + from, true);
    button.script(clock.now() + from + length, false);
  }
  /// Steps every millisecond; returns what the button requested, and when.
  std::string run(Duration time) {
    std::string actions;
    for (std::int64_t i = 0; i < time.ms(); ++i) {
      clock.advance(ms(1));
      if (sets_come && i % 33 == 0) ++view.sets;
      const auto action = panel.step(view, clock.now());
      if (action == PanelAction::kStart) view.rolling = true;
      if (action == PanelAction::kStop) view.rolling = false;
      if (action) actions += *action == PanelAction::kStart ? 'a' : *action == PanelAction::kMark ? 'm' : 'o';
      if (action) acted_at = clock.now();
    }
    return actions;
  }

  hal::sim::SimClock clock;
  hal::sim::SimInputPin button{clock};
  hal::sim::SimOutputPin status{false};
  hal::sim::SimOutputPin tally{false};
  Panel panel{{&button, &status, &tally}};
  PanelView view{"running", false, 0, FrameRate().period()};
  bool sets_come = true;
  Instant acted_at;
};

TEST_F(PanelTest, PressedWhileItStands_StartsAtOnce) {
  const Instant begun = clock.now();
  press(ms(100), ms(3000));
  EXPECT_EQ(run(ms(4000)), "a") << "the same press does not stop it again";
  EXPECT_EQ(acted_at - begun, ms(100) + Panel::kSettle);
}

TEST_F(PanelTest, PressedShortlyWhileItRolls_Marks) {
  view.rolling = true;
  press(ms(100), ms(200));
  press(ms(700), Panel::kHold - ms(1));
  EXPECT_EQ(run(ms(3000)), "mm");
}

TEST_F(PanelTest, HeldWhileItRolls_StopsWhileStillHeld) {
  view.rolling = true;
  const Instant begun = clock.now();
  press(ms(100), ms(4000));
  EXPECT_EQ(run(ms(5000)), "o");
  EXPECT_EQ(acted_at - begun, ms(100) + Panel::kHold);
}

TEST_F(PanelTest, AContactThatBounces_IsOnePress) {
  for (int i = 0; i < 10; ++i) press(ms(100 + 4 * i), ms(2));
  press(ms(140), ms(300));
  for (int i = 0; i < 10; ++i) press(ms(441 + 4 * i), ms(2));
  view.rolling = true;
  EXPECT_EQ(run(ms(2000)), "m");
}

TEST_F(PanelTest, AGlitchOfTheWire_IsNothing) {
  press(ms(100), Panel::kSettle - ms(1));
  EXPECT_EQ(run(ms(500)), "");
}

TEST_F(PanelTest, ThePanelWasNotSteppedForAWhile_APressMeanwhileIsNotLost) {
  view.rolling = true;
  press(ms(100), ms(300));
  clock.advance(ms(2000));
  EXPECT_EQ(run(ms(10)), "m");
}

TEST_F(PanelTest, EveryState_HasAPatternOfItsOwn) {
  std::vector<std::string> patterns;
  for (const char* state : {"starting", "no-calibration", "idle", "running", "degraded", "nonsense"}) {
    std::string seen;
    for (int t = 0; t < 4000; t += 25) seen += Panel::status_lamp(state, ms(t)) ? '-' : '_';
    patterns.push_back(seen);
  }
  for (std::size_t i = 0; i < patterns.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) EXPECT_NE(patterns[i], patterns[j]) << i << " " << j;
  }
  EXPECT_EQ(patterns[3].find('_'), std::string::npos);
  EXPECT_EQ(patterns[5].find('-'), std::string::npos);
}

TEST_F(PanelTest, TheTally_IsOnExactlyWhileItRollsAndSetsCome) {
  run(ms(200));
  EXPECT_FALSE(tally.level_at(clock.now())) << "it stands";
  view.rolling = true;
  run(ms(200));
  EXPECT_TRUE(tally.level_at(clock.now()));
  sets_come = false;
  run(Panel::kSilent.least + ms(100));
  EXPECT_FALSE(tally.level_at(clock.now())) << "no sets";
  sets_come = true;
  run(ms(50));
  EXPECT_TRUE(tally.level_at(clock.now()));
}

TEST_F(PanelTest, AMark_IsSeenOnTheTally) {
  view.rolling = true;
  run(ms(200));
  const std::size_t before = tally.history().size();
  press(ms(10), ms(100));
  EXPECT_EQ(run(ms(1500)), "m");
  EXPECT_GE(tally.history().size() - before, 4U);
  EXPECT_TRUE(tally.level_at(clock.now()));
}

TEST_F(PanelTest, NobodyStepsIt_TheLampsGoDark) {
  view.rolling = true;
  run(ms(300));
  EXPECT_TRUE(status.level_at(clock.now()));
  EXPECT_FALSE(status.level_at(clock.now() + Panel::kLease));
  EXPECT_FALSE(tally.level_at(clock.now() + Panel::kLease));
}

TEST_F(PanelTest, APinIsGone_ItIsSaidOnceAndTheOthersGoOn) {
  status.unplug();
  button.unplug();
  view.rolling = true;
  EXPECT_EQ(run(ms(300)), "");
  EXPECT_TRUE(tally.level_at(clock.now()));
  std::string problems;
  while (const auto problem = panel.take_problem()) problems += *problem + "\n";
  EXPECT_EQ(std::count(problems.begin(), problems.end(), '\n'), 2) << problems;
  EXPECT_NE(problems.find("status lamp"), std::string::npos);
  EXPECT_NE(problems.find("button"), std::string::npos);
}

/// A contact that has bounced again whenever it is asked.
class EndlessButton : public hal::InputPinPort {
 public:
  Result<std::optional<hal::PinEdge>> take_edge() override {
    ++asked;
    return hal::PinEdge{Instant{}, asked % 2 == 0};
  }
  Result<bool> level() override { return false; }

  int asked = 0;
};

TEST(PanelSteps, AButtonBouncesWithoutAnEnd_AStepReadsALimitedNumberOfEdges) {
  EndlessButton button;
  hal::sim::SimOutputPin status{false}, tally{false};
  Panel panel{{&button, &status, &tally}};
  const PanelView view{"running", false, 0, FrameRate().period()};
  for (int step = 1; step <= 3; ++step) {
    EXPECT_FALSE(panel.step(view, {}));
    EXPECT_EQ(button.asked, step * 64);
  }
}

}  // namespace
}  // namespace nodal::firmware
