// CALIBRATION.md's example is a valid calibration, and its worked numbers equal the program's.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>

#include "protocol/calibration.h"
#include "protocol/lens_range.h"

namespace nodal {
namespace {

std::string page() {
  std::ifstream in(std::string(NODAL_SOURCE_DIR) + "/protocol/CALIBRATION.md");
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

TEST(CalibrationPage, ItsExample_IsACalibrationAndLaidOutAsWeWriteIt) {
  const std::string text = page();
  const std::size_t begin = text.find("```json\n") + 8;
  const std::string example = text.substr(begin, text.find("```", begin) - begin);
  const Result<Calibration> read = parse_calibration(example);
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(to_json(*read), example);
}

TEST(CalibrationPage, ItsTableOfTheLens_IsRight) {
  const std::string text = page();
  const LensModel lens = TsaiLens{490, 2.29e-6, 1.65e-11};
  int rows = 0;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    double r = 0, factor = 0, ideal = 0, degrees = 0;
    if (std::sscanf(line.c_str(), "| %lf | %lf | %lf | %lf", &r, &factor, &ideal, &degrees) != 4) continue;
    ++rows;
    EXPECT_NEAR(ideal / r, factor, 2e-4) << line;
    EXPECT_NEAR(std::atan(ideal / 490) * 180 / std::numbers::pi, degrees, 0.006) << line;
    EXPECT_NEAR(lens_radius(lens, std::atan(ideal / 490)), r, 0.05) << line;
  }
  EXPECT_EQ(rows, 5);
}

}  // namespace
}  // namespace nodal
