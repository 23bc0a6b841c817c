#include "firmware/picture/calibration_swap.h"

#include <gtest/gtest.h>

#include "blender_fixture.h"
#include "firmware/picture/raymap_buffers.h"

namespace nodal::firmware {
namespace {

TEST(CalibrationSwap, ACalibrationThatWaits_IsAdoptedOnceAndReportedWithItsFirstSet) {
  CalibrationSwap swap;
  sets::SetBlend blend;
  EXPECT_FALSE(swap.adopt(blend));
  ASSERT_TRUE(swap.tables_in().push(installed("one", 1)));
  EXPECT_TRUE(swap.adopt(blend));
  EXPECT_FALSE(swap.adopt(blend));
  EXPECT_EQ(blend.plan()->name, "one");
  EXPECT_FALSE(swap.tables_out().pop()) << "there was none before";
  EXPECT_TRUE(swap.report(17, blend));
  EXPECT_FALSE(swap.report(18, blend));
  EXPECT_EQ(swap.adoption().read().first_set, 17u);
  EXPECT_EQ(swap.adoption().read().calibration, blend.plan()->id);
  EXPECT_EQ(swap.adoptions_out().pop()->first_set, 17u);
  EXPECT_FALSE(swap.adoptions_out().pop());
}

TEST(CalibrationSwap, TheCalibrationBefore_IsGivenBackWithItsMemory) {
  CalibrationSwap swap;
  sets::SetBlend blend;
  for (const char* name : {"one", "two"}) {
    ASSERT_TRUE(swap.tables_in().push(installed(name, 1)));
    ASSERT_TRUE(swap.adopt(blend));
  }
  const auto before = swap.tables_out().pop();
  ASSERT_TRUE(before);
  EXPECT_EQ(before->plan->name, "one");
  EXPECT_TRUE(before->memory);
}

TEST(CalibrationSwap, WithoutRoomToGiveBack_TheNextCalibrationWaits) {
  CalibrationSwap swap;
  sets::SetBlend blend;
  const sets::BlendSetup any = installed("any", 1);
  while (swap.tables_out().push(sets::BlendSetup(any))) continue;
  ASSERT_TRUE(swap.tables_in().push(sets::BlendSetup(any)));
  EXPECT_FALSE(swap.adopt(blend));
  swap.tables_out().pop();
  EXPECT_TRUE(swap.adopt(blend));
}

TEST(RaymapBuffers, TwoRaymapsOfASet_HaveBuffersOfTheirOwn) {
  RaymapBuffers buffers(raymap_config(), 2);
  ASSERT_TRUE(buffers.reserve(2));
  const PixelsLoan first = buffers.take(0), second = buffers.take(1);
  EXPECT_NE(first->data(), second->data());
  EXPECT_EQ(first->size(), 200u * 100u * 3u);
  EXPECT_FALSE(buffers.reserve(1)) << "both are lent";
}

TEST(RaymapBuffers, ABufferTakenForASetThatCouldNotBeBlended_IsKeptForTheNext) {
  RaymapBuffers buffers(raymap_config(), 2);
  PixelsLoan held;
  {
    ASSERT_TRUE(buffers.reserve(1));
    held = buffers.take(0);
  }
  EXPECT_FALSE(buffers.reserve(2)) << "one buffer is left, and it is reserved";
  ASSERT_TRUE(buffers.reserve(1));
  EXPECT_TRUE(buffers.take(0));
}

}  // namespace
}  // namespace nodal::firmware
