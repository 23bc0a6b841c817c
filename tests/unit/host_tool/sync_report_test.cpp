#include "host_tool/report/sync_report.h"

#include <gtest/gtest.h>

namespace nodal::host {
namespace {

wire::RaymapHeader set(std::uint64_t number, std::uint32_t mask, std::int64_t first, std::int64_t second) {
  wire::RaymapHeader header;
  header.set_set(number);
  header.set_heads_mask(mask);
  header.add_offset_ns(first);
  header.add_offset_ns(second);
  header.set_spread_ns(static_cast<std::uint64_t>(second - first));
  header.set_trigger(1000 + number);
  header.set_genlock("locked");
  return header;
}

TEST(SyncFigures, Percentiles_AreByNearestRank) {
  std::vector<std::int64_t> values;
  for (int i = 200; i >= 1; --i) values.push_back(i);
  const SyncFigures figures = SyncFigures::of(values);
  EXPECT_EQ(figures.median_ns, 100);
  EXPECT_EQ(figures.p99_ns, 198);
  EXPECT_EQ(figures.worst_ns, 200);
  EXPECT_EQ(SyncFigures::of({}).worst_ns, 0);
}

TEST(SyncReport, HundredSets_SkewsAreEachHeadsOwnWithTheirSign) {
  SyncReport report({"left", "right"});
  for (std::uint64_t i = 0; i < 100; ++i) report.add(set(i, 3, -2000, i == 50 ? 90'000 : 3000));
  const auto heads = report.heads();
  EXPECT_EQ(heads[0].median_ns, -2000);
  EXPECT_EQ(heads[0].worst_ns, 2000);
  EXPECT_EQ(heads[1].median_ns, 3000);
  EXPECT_EQ(heads[1].p99_ns, 3000) << "one in a hundred is beyond it";
  EXPECT_EQ(heads[1].worst_ns, 90'000);
  EXPECT_EQ(report.spread().worst_ns, 92'000);
  EXPECT_FALSE(report.begin_spread());
  EXPECT_FALSE(report.drift_ppb());
}

TEST(SyncReport, LostSetsPulsesAndHeads_AreEachCounted) {
  SyncReport report({"left", "right"});
  for (const std::uint64_t number : {10, 11, 14, 15}) report.add(set(number, number == 14 ? 1 : 3, 0, 500));
  wire::RaymapHeader newest = set(16, 3, 0, 500);
  newest.set_drift_ppb(-12'345);
  newest.set_begin_spread_ns(700);
  newest.set_genlock("holdover");
  report.add(newest);
  report.set_dropped(1);
  EXPECT_EQ(report.sets_lost(), 2U);
  EXPECT_EQ(report.triggers_lost(), 2U);
  EXPECT_EQ(report.heads()[1].missing, 1U);
  EXPECT_EQ(report.drift_ppb(), -12'345);
  const Json json = report.json();
  EXPECT_EQ(json["sets_lost"], 2);
  EXPECT_EQ(json["dropped"], 1);
  EXPECT_EQ(json["genlock"]["holdover"], 1);
  EXPECT_EQ(json["begin_spread"]["worst_ns"], 700);
  std::string text;
  for (const std::string& line : report.lines()) text += line + "\n";
  EXPECT_NE(text.find("-12.345 ppm"), std::string::npos) << text;
  EXPECT_NE(text.find("2 lost, 1 of them between the rig and this computer; no set came for 2 pulses"),
            std::string::npos)
      << text;
}

TEST(SyncReport, ASkewOfFiveMicroseconds_IsDrawnOnTheLineThatSaysSo) {
  SyncReport report({"left", "right"});
  for (std::uint64_t i = 0; i < 2; ++i) report.add(set(i, 3, 0, 5000));
  const std::string svg = report.svg();
  EXPECT_NE(svg.find("viewBox=\"0 0 "), std::string::npos);
  EXPECT_NE(svg.find("width=\"100%\""), std::string::npos) << "it scales with the page";
  const std::size_t word = svg.find(">+5 µs<");
  ASSERT_NE(word, std::string::npos) << svg;
  const std::string y = "y2=\"";
  const std::size_t line = svg.rfind(y, word) + y.size();  // coordinate of the line before its word
  const std::string height = svg.substr(line, svg.find('"', line) - line);
  EXPECT_NE(svg.find("points=\"80.0," + height + " 840.0," + height), std::string::npos) << svg;
}

TEST(SyncReport, AHeadGoesAndComes_ItsCurveHasAGapAndItsNameIsEscaped) {
  SyncReport report({"<left>", "right"});
  for (std::uint64_t i = 0; i < 9; ++i) report.add(set(i, i >= 3 && i < 6 ? 2 : 3, 1000, 2000));
  const std::string svg = report.svg();
  std::size_t curves = 0;
  for (std::size_t at = svg.find("<polyline"); at != std::string::npos; at = svg.find("<polyline", at + 1)) ++curves;
  EXPECT_EQ(curves, 3U) << "two of the one with the gap, one of the other";
  EXPECT_NE(svg.find("&lt;left&gt;"), std::string::npos);
  EXPECT_EQ(svg.find("<left>"), std::string::npos);
  EXPECT_TRUE(svg.ends_with("</svg>\n"));
}

}  // namespace
}  // namespace nodal::host
