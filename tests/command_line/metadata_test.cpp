// Metadata of pictures before and after every command, as exiftool reads it.
#include <gtest/gtest.h>

#include <cmath>

#include "rig_process.h"
#include "tests/support/pictures.h"

namespace nodal::command_line {
namespace {

constexpr int kSphereWide = 128, kSphereHigh = 64;

class MetadataCommand : public RigTest {
 protected:
  void SetUp() override {
    if (Process({"sh", "-c", "command -v exiftool"}).wait().code != 0) GTEST_SKIP() << "exiftool is not installed";
  }

  /// exiftool's words on a file, numbers as numbers.
  Json tags(const std::string& name) const {
    const Finished done = Process({"exiftool", "-j", "-n", path(name)}).wait();
    EXPECT_EQ(done.code, 0) << done.err;
    return Json::parse(done.out).at(0);
  }

  void tag(const std::string& name, Words words) const {
    words.insert(words.begin(), {"exiftool", "-q", "-overwrite_original"});
    words.push_back(path(name));
    const Finished done = Process(words).wait();
    ASSERT_EQ(done.code, 0) << done.err;
  }

  /// A TIFF of the same picture and metadata, as exiftool writes it: Exif in directories of its own.
  void write_tiff_sphere(const std::string& name) const {
    write_sphere("before.png");
    ASSERT_EQ(nodal({"convert", path("before.png"), "-o", path(name)}).code, 0);
    tag(name, {"-xmp-exif:all=", "-tagsfromfile", path("before.png"), "-exif:all"});
  }

  /// A sphere as a camera with a compass, level sensor and GPS writes it.
  void write_sphere(const std::string& name) const {
    const auto rgb = test::smooth_rgb(kSphereWide, kSphereHigh);
    test::write_bytes(path(name), name.ends_with(".jpg")
                                      ? test::jpeg_of(rgb, kSphereWide, kSphereHigh, test::Sampling::k420)
                                      : test::png_of(rgb, kSphereWide, kSphereHigh, 3));
    tag(name,
        {"-XMP-GPano:ProjectionType=equirectangular", "-XMP-GPano:PoseHeadingDegrees=225",
         "-XMP-GPano:PosePitchDegrees=-24.5", "-XMP-GPano:PoseRollDegrees=9", "-XMP-GPano:InitialViewHeadingDegrees=30",
         "-EXIF:DateTimeOriginal=2024:05:06 07:08:09", "-EXIF:OffsetTimeOriginal=+02:00", "-EXIF:Model=Sphere 1",
         "-EXIF:GPSLatitude=52.5083", "-EXIF:GPSLatitudeRef=S", "-EXIF:GPSLongitude=13.25", "-EXIF:GPSLongitudeRef=E",
         "-EXIF:GPSAltitude=34.5", "-EXIF:GPSAltitudeRef=0", "-EXIF:GPSImgDirection=225",
         "-EXIF:GPSImgDirectionRef=T"});
  }

  void expect_place_and_time(const Json& said, const std::string& what) const {
    EXPECT_NEAR(said.value("GPSLatitude", 0.0), -52.5083, 1e-5) << what << said;
    EXPECT_NEAR(said.value("GPSLongitude", 0.0), 13.25, 1e-5) << what;
    EXPECT_NEAR(said.value("GPSAltitude", 0.0), 34.5, 1e-3) << what;
    EXPECT_EQ(said.value("DateTimeOriginal", "").substr(0, 19), "2024:05:06 07:08:09") << what << said;
  }
};

TEST_F(MetadataCommand, AConvertedSphere_KeepsPosePlaceAndTime) {
  for (const std::string from : {"in.jpg", "in.png", "in.tif"}) {
    from == "in.tif" ? write_tiff_sphere(from) : write_sphere(from);
    for (const std::string to : {"o.jpg", "o.png", "o.tif"}) {
      const Finished done = nodal({"convert", path(from), "-o", path(to)});
      ASSERT_EQ(done.code, 0) << done.err;
      const Json said = tags(to);
      const std::string what = from + " to " + to + " ";
      EXPECT_EQ(said.value("PoseHeadingDegrees", 0.0), 225) << what << said;
      EXPECT_EQ(said.value("PosePitchDegrees", 0.0), -24.5) << what;
      EXPECT_EQ(said.value("PoseRollDegrees", 0.0), 9) << what;
      EXPECT_EQ(said.value("InitialViewHeadingDegrees", 0.0), 30) << what;
      EXPECT_EQ(said.value("FullPanoWidthPixels", 0), kSphereWide) << what;
      expect_place_and_time(said, what);
      EXPECT_EQ(said.value("Model", ""), to == "o.tif" ? "" : "Sphere 1") << what;
      EXPECT_EQ(said.value("Warning", ""), "") << what;
    }
  }
  // By way of a cube, too, which viewers do not take for a sphere.
  ASSERT_EQ(nodal({"convert", path("in.jpg"), "--layout", "cube", "-o", path("cube.png")}).code, 0);
  EXPECT_FALSE(tags("cube.png").contains("ProjectionType"));
  ASSERT_EQ(nodal({"convert", path("cube.png"), "--from", "cube", "-o", path("back.jpg")}).code, 0);
  EXPECT_EQ(tags("back.jpg").value("PosePitchDegrees", 0.0), -24.5);
  EXPECT_EQ(tags("back.jpg").value("ProjectionType", ""), "equirectangular");
}

TEST_F(MetadataCommand, AView_KeepsPlaceAndTimeAlone) {
  write_sphere("in.jpg");
  ASSERT_EQ(nodal({"view", path("in.jpg"), "-o", path("v.jpg"), "--size", "64x48"}).code, 0);
  const Json said = tags("v.jpg");
  expect_place_and_time(said, "view ");
  for (const char* key : {"PoseHeadingDegrees", "ProjectionType", "GPSImgDirection"})
    EXPECT_FALSE(said.contains(key)) << key;
}

TEST_F(MetadataCommand, AStitchedSphere_SaysWhenAndWhereAndClaimsNoNorth) {
  const auto rgb = test::smooth_rgb(96, 96);
  test::write_bytes(path("head.jpg"), test::jpeg_of(rgb, 96, 96, test::Sampling::k444));
  tag("head.jpg", {"-EXIF:DateTimeOriginal=2024:05:06 07:08:09", "-EXIF:GPSLatitude=52.5083", "-EXIF:GPSLatitudeRef=S",
                   "-EXIF:GPSLongitude=13.25", "-EXIF:GPSLongitudeRef=E", "-EXIF:GPSAltitude=34.5",
                   "-EXIF:GPSAltitudeRef=0", "-EXIF:GPSImgDirection=225"});
  for (const std::string to : {"s.jpg", "s.png", "s.tif"}) {
    Words words{"stitch", path("six.json")};
    for (int h = 0; h < 6; ++h) words.push_back(path("head.jpg"));
    words.insert(words.end(), {"--width", "64", "-o", path(to)});
    const Finished done = nodal(words);
    ASSERT_EQ(done.code, 0) << done.err;
    const Json said = tags(to);
    expect_place_and_time(said, to + " ");
    EXPECT_EQ(said.value("ProjectionType", ""), "equirectangular");
    for (const char* key : {"PoseHeadingDegrees", "GPSImgDirection"}) EXPECT_FALSE(said.contains(key)) << to << key;
  }
}

TEST_F(MetadataCommand, APictureThatKnowsNothing_GetsNoClaims) {
  test::write_bytes(path("plain.png"),
                    test::png_of(test::smooth_rgb(kSphereWide, kSphereHigh), kSphereWide, kSphereHigh, 3));
  ASSERT_EQ(nodal({"convert", path("plain.png"), "--from", "equirectangular", "-o", path("o.jpg")}).code, 0);
  const Json said = tags("o.jpg");
  EXPECT_EQ(said.value("ProjectionType", ""), "equirectangular");
  for (const char* key : {"PoseHeadingDegrees", "GPSLatitude", "DateTimeOriginal"})
    EXPECT_FALSE(said.contains(key)) << key;
}

}  // namespace
}  // namespace nodal::command_line
