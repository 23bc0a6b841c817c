#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/support/process.h"

namespace nodal {
namespace {

/// The count of `tests/bench/instructions` on Debian 12 (valgrind 3.19, g++ 12.2 -O3). It does not depend on the
/// machine's load, so it can be a test limit, unlike milliseconds. A faster blend lowers it; a change that raises
/// it must state the reason here. The machine makes a difference: the code that had 16.50 on an Intel Xeon has 17.42 on
/// an AMD EPYC (Zen 4), and so have versions of the blend from before and after two bands there.
constexpr double kInstructionsAPixel = 16.50;
constexpr double kMargin = 0.08;

TEST(BlendInstructions, Avx2OnR10_NoMoreForAPixelThanWhenLastCounted) {
  if (!std::filesystem::exists("/usr/bin/valgrind"))
    GTEST_SKIP() << "valgrind is not installed: no instructions are counted";
  if (!std::filesystem::exists("/usr/include/valgrind/callgrind.h"))
    GTEST_SKIP() << "valgrind's headers are not installed";
  if (__builtin_cpu_supports("avx2") == 0) GTEST_SKIP() << "no AVX2 here";
  test::Process count({NODAL_SOURCE_DIR "/tests/bench/instructions", "--program", NODAL_BIN_DIR "/blend_once",
                       "--kernel", "avx2", "--plain"});
  const test::Finished counted = count.wait(std::chrono::seconds(280));
  ASSERT_EQ(counted.code, 0) << counted.err;
  const std::string start = "avx2    plain";
  ASSERT_TRUE(counted.out.starts_with(start)) << counted.out;
  const double instructions = std::stod(counted.out.substr(start.size()));
  EXPECT_LT(instructions, kInstructionsAPixel * (1 + kMargin));
  EXPECT_GT(instructions, kInstructionsAPixel / 2) << "this is not the whole blend";
}

}  // namespace
}  // namespace nodal
