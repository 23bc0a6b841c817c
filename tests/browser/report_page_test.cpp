// The report of `nodal stitch` in a browser.
#include <gtest/gtest.h>

#include <algorithm>

#include "page_driver.h"
#include "tests/support/rendered_rig.h"

namespace nodal::command_line {
namespace {

constexpr int kPictureSide = 256;

class ReportPage : public PageDriver {
 protected:
  /// Six fisheyes in a town. A part of the first picture, which its neighbours see, too, is moved down by 12 px.
  Words write_town() {
    test::RenderedRig rig = test::render_rig(test::six_fisheyes(kPictureSide), hal::sim::town_square_scene(3),
                                             {PixelFormat::kRgb24, 0, 5, 3});
    constexpr int kFrom = 205, kDown = 12;
    std::vector<std::uint8_t>& first = rig.bytes.front();
    for (int y = kPictureSide - 1; y >= kDown; --y) {
      for (int x = 3 * kFrom; x < 3 * kPictureSide; ++x) {
        const auto row = [](int at) { return static_cast<std::size_t>(at) * 3 * kPictureSide; };
        first[row(y) + static_cast<std::size_t>(x)] = first[row(y - kDown) + static_cast<std::size_t>(x)];
      }
    }
    Words words{"stitch"};
    for (std::size_t k = 0; k < rig.bytes.size(); ++k) {
      words.push_back(path(rig.truth.heads[k].name + ".png"));
      test::write_bytes(words.back(), test::png_of(rig.bytes[k], kPictureSide, kPictureSide, 3));
    }
    words.insert(words.end(), {"-o", path("s.jpg"), "--json"});
    return words;
  }
};

TEST_F(ReportPage, StitchedSphere_TurnsShowsItsPoorSeamsAndFitsEveryWindow) {
  const test::Finished run = nodal(write_town());
  ASSERT_EQ(run.code, 0) << run.err;
  const Json seams = Json::parse(run.out)["seams"];
  const auto poor = std::ranges::count_if(seams, [](const Json& seam) { return seam["verdict"] != "good"; });
  ASSERT_GT(poor, 0) << "lines jump in the moved part";
  const std::vector<Json> seen =
      run_script({"report_page.mjs", path("s.report.html"), folder_.path().string(), "360", "1400"});
  ASSERT_EQ(seen.size(), 4U) << "light and dark";
  for (const Json& page : seen) {
    EXPECT_EQ(page["wider"], 0) << page;
    EXPECT_EQ(page["beside"], Json::array()) << page["width"];
    EXPECT_EQ(page["axe"], Json::array()) << page["width"];
    EXPECT_EQ(page["errors"], Json::array());
    EXPECT_TRUE(page["turned"]) << "dragging turns the sphere";
    EXPECT_TRUE(page["back"]) << "Home turns it back";
    EXPECT_EQ(page["crops"].size(), static_cast<std::size_t>(std::min<std::ptrdiff_t>(poor, 6)));
    EXPECT_EQ(page["title"], "Sphere of 6 pictures");
    for (const Json& url : page["requests"]) EXPECT_FALSE(url.get<std::string>().starts_with("http")) << url;
  }
}

}  // namespace
}  // namespace nodal::command_line
