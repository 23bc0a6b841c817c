// Lists of rays as a layout.
#include "stitch/geometry/raymap/ray_list.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {
namespace {

const std::string kFour = "# four corners\nrays 2 2\n1 1 1\n  -1\t-1 1 # the second\r\n\n-2e3 2e3 -2e3\n0.1 -.1 -0.1\n";

TEST(RayList, EveryPixelHasTheRayOfItsLine) {
  const std::string name = make_ray_list_known(kFour).value();
  const LayoutName parsed = LayoutName::parse(name).value();
  EXPECT_EQ(parsed.text(), name);
  EXPECT_TRUE(parsed.is_ray_list());
  EXPECT_EQ(parsed.size_for_width(1000).width, 2) << "whatever is wished";
  EXPECT_TRUE(parsed.check_size({2, 2}));
  EXPECT_FALSE(parsed.check_size({4, 4}));
  const auto layout = make_layout(name, 2, 2).value();
  EXPECT_TRUE(layout->scattered());
  const double expected[4][3] = {{1, 1, 1}, {-1, -1, 1}, {-1, 1, -1}, {1, -1, -1}};
  double sum = 0;
  for (int k = 0; k < 4; ++k) {
    const Ray ray = layout->ray(k % 2 + 0.5, k / 2 + 0.5).value();
    EXPECT_LE(angle_between(ray, Ray::towards(expected[k][0], expected[k][1], expected[k][2])), 1e-15);
    EXPECT_EQ(layout->pixel(ray), (Pixel{k % 2 + 0.5, k / 2 + 0.5}));
    sum += layout->solid_angle(k % 2, k / 2);
  }
  EXPECT_NEAR(sum, 4 * std::acos(-1.0), 1e-12);
}

TEST(RayList, Names_AreTheFilesSha256) {
  // By `printf 'rays 2 2\\n1 0 0\\n0 1 0\\n0 0 1\\n1 1 1\\n' | sha256sum`.
  EXPECT_EQ(make_ray_list_known("rays 2 2\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n").value(), "rays:71c883fa29988923");
  EXPECT_FALSE(make_layout("rays:71c883fa29988923", 4, 2)) << "of another size";
}

TEST(RayList, UnknownNames_SayWhatToGive) {
  for (const std::string name : {"rays:0000000000000000", "rays:", "rays", "rays:list.txt", "rays:000000000000000G"}) {
    const Result<LayoutName> unknown = LayoutName::parse(name);
    ASSERT_FALSE(unknown) << name;
    EXPECT_NE(unknown.error().message.find("rays:FILE"), std::string::npos) << unknown.error().message;
  }
}

void expect_no_list(const std::string& text, Errc code, const std::string& says) {
  const Result<RayList> list = parse_ray_list(text);
  ASSERT_FALSE(list) << says;
  EXPECT_EQ(list.error().code, code) << list.error().message;
  EXPECT_NE(list.error().message.find(says), std::string::npos) << list.error().message;
}

TEST(RayList, BadLists_AreRefusedWithTheLine) {
  expect_no_list("", Errc::kBadFormat, "no list of rays");
  expect_no_list("\n1 0 0\n", Errc::kBadFormat, "line 2: the first line must be: rays WIDTH HEIGHT");
  expect_no_list("rays 2\n", Errc::kBadFormat, "line 1");
  expect_no_list("rays 3 2\n", Errc::kBadValue, "line 1: width and height must be even");
  expect_no_list("rays 40000 2\n", Errc::kBadValue, "line 1");
  expect_no_list("rays 32768 32768\n", Errc::kTooLarge, "at most 2097152 rays");
  expect_no_list("rays 99999999999 2\n", Errc::kBadFormat, "line 1");
  const std::string two = "rays 2 2\n1 0 0\n0 1 0\n";
  expect_no_list(two, Errc::kTruncated, "there are 2 rays, and the first line says 4");
  for (const std::string ray : {"1 0", "1 0 0 0", "1 0 x", "1,0,0", "1 0 0x1"})
    expect_no_list(two + ray + "\n", Errc::kBadFormat, "line 4: a ray is three numbers");
  for (const std::string ray : {"0 0 0", "nan 0 0", "1 inf 0", "1e-200 0 0", "1e300 0 0"})
    expect_no_list(two + ray + "\n", Errc::kBadValue, "line 4: the ray is no direction");
  expect_no_list(two + "3 0 0\n0 0 1\n", Errc::kBadValue, "line 4: the ray is the same as that of line 2");
  expect_no_list(two + "0 0 1\n1 1 1\n1 1 0\n", Errc::kBadFormat, "line 6: there are more than the 4 rays");
  expect_no_list(std::string(kMaxRayFileBytes + 1, '#'), Errc::kTooLarge, "bytes");
}

TEST(RayList, MoreThanAreUsedAtOnce_AreRefused) {
  std::size_t known = 0;
  for (int k = 1; k < 40; ++k) {
    if (make_ray_list_known("rays 2 2\n" + std::to_string(k) + " 1 0\n0 1 0\n0 0 1\n1 1 1\n")) ++known;
  }
  EXPECT_LE(known, kMaxRayLists);
  EXPECT_GE(known, kMaxRayLists - 2) << "those of the tests above";
  EXPECT_TRUE(make_ray_list_known("rays 2 2\n1 1 0\n0 1 0\n0 0 1\n1 1 1\n")) << "known already";
}

}  // namespace
}  // namespace nodal::geometry
