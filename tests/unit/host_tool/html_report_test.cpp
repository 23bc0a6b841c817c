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

TEST(HtmlReport, ASphere_IsAPictureThatTheScriptTurns) {
  HtmlReport report("r", "s"), folded("", "");
  EXPECT_FALSE(holds(report.finish(), "<script>")) << "a page without a sphere needs none";
  folded.sphere(std::vector<std::uint8_t>{0xFF, 0xD8, 0x00}, "it <", {0, 0.25, 1, 0.5});
  report.details("more", folded);
  const std::string page = report.finish();
  EXPECT_TRUE(
      holds(page, "<figure class=\"wide sphere\" data-part=\"0,0.25,1,0.5\"><img src=\"data:image/jpeg;base64,"));
  EXPECT_TRUE(holds(page, "alt=\"it &lt;\""));
  EXPECT_EQ(page.find("<script>"), page.rfind("<script>")) << "once";
  EXPECT_LT(page.find("</figure>"), page.find("<script>"));
}

TEST(HtmlReport, WholePage_AsksNoNetworkForAnything) {
  HtmlReport report("r", "s");
  report.sphere(std::vector<std::uint8_t>{1, 2}, "sphere", {0, 0, 1, 1});
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

TEST(HtmlReport, LogarithmicAxis_IsMarkedAtOneTwoAndFive) {
  HtmlReport report("r", "s");
  report.chart("c", "x", "y", {{"one", {{0, 3}, {1, 70}}}}, true);
  const std::string page = report.finish();
  for (const char* mark : {">2<", ">5<", ">10<", ">20<", ">50<", ">100<"}) EXPECT_TRUE(holds(page, mark)) << mark;
  EXPECT_FALSE(holds(page, ">3<"));
  EXPECT_FALSE(holds(page, ">200<"));
  HtmlReport wide("r", "s");
  wide.chart("c", "x", "y", {{"one", {{0, 0.01}, {1, 1000}}}}, true);
  EXPECT_TRUE(holds(wide.finish(), ">0.1<"));
  EXPECT_FALSE(holds(wide.finish(), ">20<")) << "over more than three decades only powers of ten";
}

TEST(HtmlReport, PageWithoutColoursOrPicturesOrRoom_StillTells) {
  HtmlReport report("r", "s");
  report.pictures({{{0x89, 0x50}, "the \"sphere\""}});
  report.chart("c", "x", "y", {{"one", {{0, 1}, {1, 2}}}, {"two", {{0, 2}, {1, 1}}}});
  report.table({"head"}, {{"cam0"}});
  const std::string page = report.finish();
  EXPECT_TRUE(holds(page, "alt=\"the &quot;sphere&quot;\"")) << "a picture has a text that says what it shows";
  EXPECT_TRUE(holds(page, "<figure class=\"wide\">")) << "one picture alone is as wide as the page";
  EXPECT_TRUE(holds(page, "role=\"img\" aria-label=\"c: y over x\""));
  EXPECT_TRUE(holds(page, "stroke-dasharray=\"7 3\" points=")) << "curves differ by more than their colour";
  EXPECT_TRUE(holds(page, "<div class=\"table\" tabindex=\"0\"><table>"))
      << "a wide table scrolls by itself on a narrow page";
  EXPECT_TRUE(holds(page, "svg{background:#fafafa;border:1px solid #eee;max-width:100%"));
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
