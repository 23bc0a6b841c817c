#include "host_tool/report/sphere_graph.h"

#include <gtest/gtest.h>

#include <regex>

namespace nodal::host {
namespace {

std::size_t count(const std::string& text, const std::string& what) {
  std::size_t n = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
  return n;
}

TEST(SphereGraph, HeadsStandWhereTheyLook_FrontInTheMiddleRightToTheRightAndUpUp) {
  const std::string svg = sphere_graph({{"front", 0, 0}, {"right", 90, 0}, {"up", 0, 60}}, {});
  // The map is 760 by 360.
  EXPECT_NE(svg.find("cx=\"380.0\" cy=\"180.0\""), std::string::npos);
  EXPECT_NE(svg.find("cx=\"570.0\" cy=\"180.0\""), std::string::npos);
  EXPECT_NE(svg.find("cx=\"380.0\" cy=\"60.0\""), std::string::npos);
}

TEST(SphereGraph, AHeadThatLooksBack_StandsHalfOnEitherSide) {
  const std::string svg = sphere_graph({{"back", 180, 0}, {"ahead", 0, 0}}, {});
  EXPECT_EQ(count(svg, ">back<"), 2u);
  EXPECT_EQ(count(svg, ">ahead<"), 1u);
}

TEST(SphereGraph, NamesAtTheEdges_AreNotCutOff) {
  for (const std::string name : {"W", "back", "WWWWWWWW", "the-head-at-the-back"}) {
    for (double yaw = -180; yaw <= 180; yaw += 0.5) {
      const std::string svg = sphere_graph({{name, yaw, 0}}, {});
      const std::regex text("<text x=\"([0-9.-]+)\" y=\"[0-9.]+\" text-anchor=\"(start|middle|end)\"[^>]*>" + name +
                            "<");
      std::size_t found = 0;
      for (std::sregex_iterator at(svg.begin(), svg.end(), text), end; at != end; ++at, ++found) {
        // W, the widest letter of the usual fonts, is about as wide as the font is high, which is 9.5 here.
        const double x = std::stod((*at)[1]), width = 9.5 * static_cast<double>(name.size());
        const double left = (*at)[2] == "start" ? x : (*at)[2] == "end" ? x - width : x - width / 2;
        ASSERT_GE(left, 0) << name << " at " << yaw;
        ASSERT_LE(left + width, 760) << name << " at " << yaw;
      }
      ASSERT_EQ(found, count(svg, ">" + name + "<")) << yaw;
      ASSERT_GE(found, 1U);
    }
  }
}

TEST(SphereGraph, LinkOverTheBack_LeavesOnOneSideAndComesInOnTheOther) {
  const std::vector<GraphNode> nodes{{"a", 150, 0}, {"b", -150, 0}, {"c", 100, 0}};
  const std::string near = sphere_graph(nodes, {{0, 2, 1, 1, "near pair"}});
  EXPECT_EQ(count(near, "near pair"), 1u);
  const std::string over = sphere_graph(nodes, {{0, 1, 1, 1, "over the back"}});
  EXPECT_EQ(count(over, "over the back"), 2u);
  // From a at 696.7 to b at 63.3 + 760, and from a - 760 to b.
  EXPECT_NE(over.find("x1=\"696.7\" y1=\"180.0\" x2=\"823.3\""), std::string::npos);
  EXPECT_NE(over.find("x1=\"-63.3\" y1=\"180.0\" x2=\"63.3\""), std::string::npos);
}

TEST(SphereGraph, WhatIsNotSure_LooksIt) {
  const std::string svg = sphere_graph({{"a<b", 0, 0, true}, {"c", 50, 0}}, {{0, 1, 0.5, 0.1, "a & c"}});
  EXPECT_NE(svg.find("stroke=\"#c92a2a\" stroke-width=\"5.2\""), std::string::npos);
  EXPECT_NE(svg.find("stroke-dasharray=\"3 3\""), std::string::npos);
  EXPECT_NE(svg.find("a&lt;b"), std::string::npos);
  EXPECT_NE(svg.find("a &amp; c"), std::string::npos);
}

}  // namespace
}  // namespace nodal::host
