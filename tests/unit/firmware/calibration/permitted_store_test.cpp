#include "firmware/calibration/permitted_store.h"

#include <gtest/gtest.h>

#include "hal/sim/disk.h"
#include "tests/support/rigs.h"

namespace nodal::firmware {
namespace {

using hal::sim::SimDisk;

const std::optional<AllowedSigners> kNoSigners;

Calibration named(const std::string& name) {
  Calibration calibration = test::ring(3, 64, 48);
  calibration.name = name;
  return calibration;
}

TEST(PermittedStore, AnAcceptedCalibration_IsStoredOnlyWhenItIsPut) {
  SimDisk disk;
  PermittedStore store(kNoSigners, "rig");
  ASSERT_TRUE(store.open(disk));
  const auto accepted = store.accept({"", canonical_json(named("one"))}, false);
  ASSERT_TRUE(accepted) << accepted.error().text();
  EXPECT_FALSE(accepted->stored);
  EXPECT_FALSE(accepted->original) << "no signatures are required";
  EXPECT_TRUE(store.contents().entries().empty());
  ASSERT_TRUE(store.put(accepted->calibration, accepted->original));
  EXPECT_TRUE(store.accept({"", canonical_json(named("one"))}, false)->stored);
}

TEST(PermittedStore, OneThatCannotBePutInForce_IsNotKeptAndTheOldOneStaysInForce) {
  std::uint64_t operations = 0;  // how many a keep() that succeeds has
  for (std::uint64_t failing = 0; failing <= operations; ++failing) {
    SimDisk disk;
    PermittedStore store(kNoSigners, "rig");
    ASSERT_TRUE(store.open(disk));
    ASSERT_TRUE(store.keep(named("old"), std::nullopt));
    const std::uint64_t before = disk.operations();
    if (operations > 0) disk.fail_at(before + failing - 1);
    const Status kept = store.keep(named("new"), std::nullopt);
    if (operations == 0) {
      ASSERT_TRUE(kept);
      operations = disk.operations() - before;
      continue;
    }
    const Sha256 in_force = calibration_id(named(kept ? "new" : "old"));
    EXPECT_EQ(store.contents().in_force(), in_force) << "operation " << failing;
    EXPECT_EQ(store.contents().entries().size(), kept ? 2u : 1u) << "operation " << failing;
  }
}

}  // namespace
}  // namespace nodal::firmware
