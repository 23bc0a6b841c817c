// The disk fails in every single operation of a calibration swap; afterwards the rig is started again.
#include <gtest/gtest.h>

#include <functional>
#include <optional>

#include "firmware/calibration/calibration_keeper.h"
#include "hal/sim/disk.h"
#include "tests/scenario/small_rig.h"

namespace nodal::crash {
namespace {

using firmware::CalibrationAnswer;
using firmware::CalibrationKeeper;
using firmware::CalibrationRequest;
using firmware::CalibrationStore;
using hal::sim::SimDisk;

firmware::RigConfig tiny_config() {
  firmware::RigConfig config = scenario::small_config();
  config.raymap.width = 32;
  config.raymap.height = 16;
  return config;
}

/// The keeper with a blend stage that accepts every table at once.
class Keeping {
 public:
  explicit Keeping(SimDisk& disk) : keeper(tiny_config(), disk, out_, back_) { run(); }

  void run() {
    for (int i = 0; i < 1000; ++i) {
      bool busy = keeper.step(now);
      while (auto table = out_.pop()) {
        running = table->plan->id;
        busy = true;
      }
      if (!busy) return;
    }
    FAIL() << "the keeper does not come to rest";
  }
  Status ask(decltype(CalibrationRequest::what) what) {
    EXPECT_TRUE(keeper.requests().push(CalibrationRequest{1, std::move(what), {}}));
    run();
    const auto answer = keeper.answers().pop();
    if (!answer) return fail(Errc::kInternal, "no answer");
    if (!answer->result) return fail(answer->result.error());
    return {};
  }

 private:
  SpscRing<sets::BlendSetup> out_{1};
  SpscRing<sets::BlendSetup> back_{8};

 public:
  CalibrationKeeper keeper;
  std::optional<Sha256> running;  ///< the calibration that the blend uses
  Instant now;
};

Calibration numbered(int n) { return scenario::small_calibration("number " + std::to_string(n)); }

CalibrationRequest::Install install(const Calibration& calibration) { return {to_json(calibration), {}}; }

/// The calibrations that may be in force after the power loss; the one in force must be complete.
void expect_either(std::unique_ptr<SimDisk> disk, const std::optional<Sha256>& old, const Sha256& fresh,
                   const std::string& when) {
  auto store = CalibrationStore::open(*disk);
  ASSERT_TRUE(store) << when << ": " << store.error().text();
  if (!store->in_force()) {
    EXPECT_FALSE(old.has_value()) << when << ": nothing is in force any more";
  } else {
    EXPECT_TRUE(store->in_force() == old || store->in_force() == fresh) << when;
    const auto loaded = store->load(*store->in_force());
    ASSERT_TRUE(loaded) << when << ": " << loaded.error().text();
  }
  // A rig that starts on this disk uses that calibration, and accepts the new one.
  Keeping again(*disk);
  EXPECT_EQ(again.running, store->in_force()) << when;
  EXPECT_TRUE(again.ask(CalibrationRequest::List{})) << when;
}

/// Fails the disk at every operation of `act` on a disk made by `arrange`, and checks the result.
void kill_everywhere(const std::function<void(Keeping&)>& arrange, const std::function<Status(Keeping&)>& act,
                     const std::optional<Sha256>& old, const Sha256& fresh, int seeds,
                     std::uint64_t least_operations = 10) {
  std::uint64_t operations = 0;
  std::uint64_t before = 0;
  {
    SimDisk disk;
    Keeping keeping(disk);
    arrange(keeping);
    before = disk.operations();
    ASSERT_TRUE(act(keeping));
    EXPECT_EQ(keeping.running, fresh);
    operations = disk.operations() - before;
  }
  // A file is written by create, write, fsync, rename, fsync of the folder: first the document, then the one in force.
  ASSERT_GE(operations, least_operations);
  for (std::uint64_t k = 0; k < operations; ++k) {
    SimDisk disk;
    Keeping keeping(disk);
    arrange(keeping);
    disk.die_at(before + k);
    const Status done = act(keeping);
    ASSERT_TRUE(disk.dead()) << k;
    const std::string when = "killed in operation " + std::to_string(k) + " of " + std::to_string(operations);
    // After a successful reply the old calibration must not be in force.
    const std::optional<Sha256> may_be_old = done ? std::optional<Sha256>(fresh) : old;
    expect_either(disk.after_kill(), may_be_old, fresh, when + ", program only");
    for (int seed = 0; seed < seeds; ++seed) {
      expect_either(disk.after_power_loss(static_cast<std::uint64_t>(seed)), may_be_old, fresh,
                    when + ", power, seed " + std::to_string(seed));
    }
  }
}

TEST(CalibrationSwap, KilledInAnyDiskOperation_TheOldOrTheNewOneIsInForceWhole) {
  kill_everywhere([](Keeping& keeping) { ASSERT_TRUE(keeping.ask(install(numbered(1)))); },
                  [](Keeping& keeping) { return keeping.ask(install(numbered(2))); }, calibration_id(numbered(1)),
                  calibration_id(numbered(2)), 20);
}

TEST(CalibrationSwap, TheFirstOneEverKilledInAnyDiskOperation_NoneOrItIsInForce) {
  kill_everywhere([](Keeping&) {}, [](Keeping& keeping) { return keeping.ask(install(numbered(1))); }, std::nullopt,
                  calibration_id(numbered(1)), 20);
}

TEST(CalibrationSwap, KilledInAnyDiskOperationOfARollback_EitherOfTheTwoIsInForce) {
  kill_everywhere(
      [](Keeping& keeping) {
        ASSERT_TRUE(keeping.ask(install(numbered(1))));
        ASSERT_TRUE(keeping.ask(install(numbered(2))));
      },
      [](Keeping& keeping) { return keeping.ask(CalibrationRequest::Rollback{}); }, calibration_id(numbered(2)),
      calibration_id(numbered(1)), 20, 5);
}

CalibrationRequest::Use use(const Calibration& calibration) {
  const Sha256 id = calibration_id(calibration);
  return {std::string(id.begin(), id.end())};
}

TEST(CalibrationSwap, KilledInAnyDiskOperationBetweenTwoOldOnes_TheNewestIsNotTakenForThem) {
  kill_everywhere(
      [](Keeping& keeping) {
        for (int i = 1; i <= 3; ++i) ASSERT_TRUE(keeping.ask(install(numbered(i))));
        ASSERT_TRUE(keeping.ask(use(numbered(1))));
      },
      [](Keeping& keeping) { return keeping.ask(use(numbered(2))); }, calibration_id(numbered(1)),
      calibration_id(numbered(2)), 20, 5);
}

TEST(CalibrationSwap, KilledInAnyDiskOperationOfKeepingATrial_TheOldOneOrTheTriedOneIsInForce) {
  kill_everywhere(
      [](Keeping& keeping) {
        ASSERT_TRUE(keeping.ask(install(numbered(1))));
        ASSERT_TRUE(keeping.ask(CalibrationRequest::Install{to_json(numbered(2)), Duration::seconds(60)}));
      },
      [](Keeping& keeping) {
        return keeping.ask(CalibrationRequest::EndTrial{"", true});
      },
      calibration_id(numbered(1)), calibration_id(numbered(2)), 20);
}

TEST(CalibrationSwap, ATrial_TouchesNoDiskUntilItIsKept) {
  SimDisk disk;
  Keeping keeping(disk);
  ASSERT_TRUE(keeping.ask(install(numbered(1))));
  const std::uint64_t before = disk.operations();
  ASSERT_TRUE(keeping.ask(CalibrationRequest::Install{to_json(numbered(2)), Duration::seconds(60)}));
  EXPECT_EQ(keeping.running, calibration_id(numbered(2)));
  keeping.now = keeping.now + Duration::seconds(59);
  keeping.run();
  EXPECT_EQ(keeping.running, calibration_id(numbered(2)));
  keeping.now = keeping.now + Duration::seconds(1);
  keeping.run();
  EXPECT_EQ(keeping.running, calibration_id(numbered(1)));
  EXPECT_EQ(disk.operations(), before);
}

TEST(CalibrationSwap, KilledWhileAFullStoreMakesRoom_NothingThatIsNeededIsMissing) {
  constexpr int kMany = static_cast<int>(CalibrationStore::kKept) + 1;
  kill_everywhere(
      [](Keeping& keeping) {
        for (int i = 1; i < kMany; ++i) ASSERT_TRUE(keeping.ask(install(numbered(i))));
      },
      [](Keeping& keeping) { return keeping.ask(install(numbered(kMany))); }, calibration_id(numbered(kMany - 1)),
      calibration_id(numbered(kMany)), 5);
}

TEST(CalibrationSwap, AnyOneDiskOperationFails_TheOldOneStaysAndTheNextTryWorks) {
  SimDisk counted;
  Keeping counting(counted);
  ASSERT_TRUE(counting.ask(install(numbered(1))));
  const std::uint64_t before = counted.operations();
  ASSERT_TRUE(counting.ask(install(numbered(2))));
  const std::uint64_t operations = counted.operations() - before;
  for (std::uint64_t k = 0; k < operations; ++k) {
    SimDisk disk;
    Keeping keeping(disk);
    ASSERT_TRUE(keeping.ask(install(numbered(1))));
    disk.fail_at(before + k);
    const Status done = keeping.ask(install(numbered(2)));
    const Sha256 expected = calibration_id(numbered(done ? 2 : 1));
    EXPECT_TRUE(done || done.error().code == Errc::kIo) << done.error().text();
    EXPECT_EQ(keeping.running, expected) << "operation " << k;
    Keeping again(disk);
    EXPECT_EQ(again.running, expected) << "after a restart, operation " << k;
    EXPECT_TRUE(again.ask(install(numbered(3)))) << "operation " << k;
  }
}

TEST(CalibrationSwap, TheDiskFillsUpAtAnyByte_TheOldOneStays) {
  const std::string document = canonical_json(numbered(2));
  for (std::size_t room = 0; room < document.size() + 200; room += 97) {
    SimDisk disk;
    Keeping keeping(disk);
    ASSERT_TRUE(keeping.ask(install(numbered(1))));
    disk.set_capacity((std::uint64_t{1} << 40) - *disk.free_bytes() + room);
    const Status done = keeping.ask(install(numbered(2)));
    const Sha256 expected = calibration_id(numbered(done ? 2 : 1));
    EXPECT_TRUE(done || done.error().code == Errc::kDiskFull) << done.error().text();
    EXPECT_EQ(keeping.running, expected) << room;
    Keeping again(disk);
    EXPECT_EQ(again.running, expected) << room;
  }
}

}  // namespace
}  // namespace nodal::crash
