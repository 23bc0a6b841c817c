#include "host_tool/report/html_report.h"

#include <gtest/gtest.h>

#include <cmath>

namespace nodal::host {
namespace {

bool holds(const std::string& page, const std::string& words) { return page.find(words) != std::string::npos; }

TEST(HtmlReport, TextWithMarkup_IsEscaped) {
  HtmlReport report("a <b> & \"c\"", "<script>");
  report.warning("1 < 2");
  report.table({"<x>"}, {{"<y>", "-1.5 %"}});
  const std::string page = report.finish();
  EXPECT_TRUE(holds(page, "<title>a &lt;b&gt; &amp; &quot;c&quot;</title>"));
  EXPECT_FALSE(holds(page, "<script>"));
  EXPECT_TRUE(holds(page, "1 &lt; 2"));
  EXPECT_TRUE(holds(page, "<td>&lt;y&gt;</td><td class=\"n\">-1.5 %</td>"));
}

TEST(HtmlReport, Pictures_AreInsideByBase64) {
  HtmlReport report("r", "");
  // RFC 4648, section 10: BASE64("foobar") = "Zm9vYmFy", "fooba" = "Zm9vYmE=", "foob" = "Zm9vYg==".
  for (const std::string text : {"foobar", "fooba", "foob"}) report.pictures({{{text.begin(), text.end()}, text}});
  report.pictures({{{0xFF, 0xD8, 0x00}, "jpeg"}});
  const std::string page = report.finish();
  EXPECT_TRUE(holds(page, "data:image/png;base64,Zm9vYmFy\""));
  EXPECT_TRUE(holds(page, "data:image/png;base64,Zm9vYmE=\""));
  EXPECT_TRUE(holds(page, "data:image/png;base64,Zm9vYg==\""));
  EXPECT_TRUE(holds(page, "data:image/jpeg;base64,/9gA\""));
}

TEST(HtmlReport, WholePage_AsksNoNetworkForAnything) {
  HtmlReport report("r", "s");
  report.heading("h");
  report.chart("c", "x", "y", {{"one", {{0, 1}, {1, 2}}}});
  const std::string page = report.finish();
  EXPECT_FALSE(holds(page, "http"));
  EXPECT_FALSE(holds(page, "src=\"/"));
}

TEST(HtmlReport, CurveOfStraightLine_RunsFromCornerToCorner) {
  HtmlReport report("r", "s");
  report.chart("c", "x", "y", {{"line", {{0, 0}, {5, 50}, {10, 100}}}});
  // The axes end at round numbers: 0..10 and 0..100, over the drawing's 62..506 and 258..26.
  EXPECT_TRUE(holds(report.finish(), "points=\"62.0,258.0 284.0,142.0 506.0,26.0 \""));
}

TEST(HtmlReport, ValuesThatAreNotFinite_AreLeftOut) {
  HtmlReport report("r", "s");
  report.chart("none", "x", "y", {{"nothing", {{0, NAN}}}});
  report.chart("log", "x", "y", {{"one", {{0, 0.0}, {1, 10}, {2, 100}}}}, true);
  const std::string page = report.finish();
  EXPECT_FALSE(holds(page, "nan"));
  EXPECT_FALSE(holds(page, "inf"));
  EXPECT_FALSE(holds(page, ">none<"));
  EXPECT_TRUE(holds(page, ">log<"));
}

}  // namespace
}  // namespace nodal::host
