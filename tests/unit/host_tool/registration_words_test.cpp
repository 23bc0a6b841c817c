// What `nodal register` says beside the library's sentences: options that may help, pairs that do not agree.
#include <gtest/gtest.h>

#include "host_tool/console/console.h"
#include "host_tool/input/registration_advice.h"
#include "host_tool/report/registration_report.h"

namespace nodal::host {
namespace {

TEST(RegistrationAdvice, NoCoverageAndMismatch_NameTheOptionsThatMayHelpAndWhen) {
  const std::string coverage = with_advice({Errc::kNoCoverage, "nothing shared"}, false).message;
  EXPECT_TRUE(coverage.starts_with("nothing shared. ")) << coverage;
  EXPECT_NE(coverage.find("--free light, if "), std::string::npos) << coverage;
  EXPECT_NE(coverage.find("--pairs FILE, if "), std::string::npos) << coverage;
  EXPECT_EQ(coverage.find("--circle"), std::string::npos) << "only a nominal rig has circles to set";
  const std::string mismatch = with_advice({Errc::kHeadMismatch, "other lenses"}, true).message;
  for (const char* option : {"--pairs FILE, if ", "--free focals, if ", "--circle X,Y,R, if ", "--lens FAMILY, if ",
                             "--roll DEGREES, if "}) {
    EXPECT_NE(mismatch.find(option), std::string::npos) << option;
  }
}

TEST(RegistrationAdvice, OtherErrors_StayAsTheyAre) {
  EXPECT_EQ(with_advice({Errc::kNotDetermined, "head 'cam0' is black"}, true).message, "head 'cam0' is black");
}

TEST(PoorPairs, PlacedHeadsThatTheReportMarksRed_AreNamed) {
  registration::Report report;
  report.heads.resize(3);
  for (std::size_t h = 0; h < 3; ++h) report.heads[h].name = "cam" + std::to_string(h);
  const auto pair = [](int a, int b, double agreement) {
    registration::PairReport one;
    one.a = a, one.b = b, one.agreement = agreement;
    return one;
  };
  report.pairs = {pair(0, 1, 0.9), pair(0, 2, 0.39), pair(1, 2, 0.4)};
  const std::string poor = poor_pairs(report);
  EXPECT_NE(poor.find("'cam0' and 'cam2' (0.39)"), std::string::npos) << poor;
  EXPECT_EQ(poor.find("cam1"), std::string::npos) << poor;
  report.heads[2].placed = false;
  EXPECT_EQ(poor_pairs(report), "") << "a head that is not placed has its own warning";
}

}  // namespace
}  // namespace nodal::host
