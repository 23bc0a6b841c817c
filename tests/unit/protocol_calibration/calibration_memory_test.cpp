// Calibrations that are as large as they may be, and hostile ones: reading them stays within the memory of LIMITS.md.
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "examples.h"
#include "protocol/calibration.h"
#include "protocol/calibration_limits.h"
#include "tests/support/within_memory.h"

namespace nodal {
namespace {

const std::uint64_t kMiB = test::memory_on_page(NODAL_SOURCE_DIR, "a document");

std::string filled(const std::string& head, const std::string& part, const std::string& tail) {
  std::string text = head;
  while (text.size() + part.size() + tail.size() <= kMaxCalibrationBytes) text += part;
  return text + tail;
}

TEST(CalibrationMemory, HostileDocumentsOfTheLargestSize_AreRefusedWithinTheirBudget) {
  const std::string begin = R"({"nodal_calibration": 1, "name": "x", "comment": "", "heads": [)";
  for (const auto& [what, text] : std::vector<std::pair<std::string, std::string>>{
           {"objects", filled(begin, "{},", "{}]}")},
           {"lists", filled(begin, "[],", "[]]}")},
           {"lists in lists of masks", filled(begin + R"({"region": {"masks": [)", "[[0,0],[1,1]],", "[]]}}]}")},
           {"numbers", filled(begin + R"({"center": [)", "1,", "1]}]}")},
           {"fields", filled("{", "\"a\":{},", "\"b\": 1}")},
           {"a text", filled("{\"name\": \"", "aaaaaaaa", "\"}")},
           {"white space", filled("", " ", "")}}) {
    EXPECT_TRUE(test::within_memory(kMiB, [&] { return !parse_calibration(text); })) << what;
  }
}

TEST(CalibrationMemory, AsManyHeadsAsThereMayBe_AreReadWithinTheirBudget) {
  Calibration calibration = two_heads();
  const HeadCalibration head = calibration.heads.front();
  calibration.heads.clear();
  for (std::size_t k = 0; k < kMaxCalibratedHeads; ++k) {
    calibration.heads.push_back(head);
    calibration.heads.back().name = "head" + std::to_string(k);
  }
  const std::string text = to_json(calibration);
  EXPECT_TRUE(test::within_memory(kMiB, [&] { return parse_calibration(text).has_value(); }));
}

}  // namespace
}  // namespace nodal
