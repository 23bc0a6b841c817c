// Metadata of pictures before and after every command, as exiftool reads it.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <ctime>

#include "colour_chart.h"
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

  /// A picture as a camera with a compass, level sensor and GPS writes it; a sphere by its metadata. `darker`: levels.
  void write_picture(const std::string& name, int width, int height, int darker = 0) const {
    auto rgb = test::smooth_rgb(width, height);
    for (auto& level : rgb) level = static_cast<std::uint8_t>(std::max(0, level - darker));
    if (name.ends_with(".tif")) {
      write_tiff(path(name), rgb, {.width = width, .height = height});
    } else {
      test::write_bytes(path(name), name.ends_with(".jpg") ? test::jpeg_of(rgb, width, height, test::Sampling::k420)
                                                           : test::png_of(rgb, width, height, 3));
    }
    tag(name,
        {"-XMP-GPano:ProjectionType=equirectangular", "-XMP-GPano:PoseHeadingDegrees=225",
         "-XMP-GPano:PosePitchDegrees=-24.5", "-XMP-GPano:PoseRollDegrees=9", "-XMP-GPano:InitialViewHeadingDegrees=30",
         "-EXIF:DateTimeOriginal=2024:05:06 07:08:09", "-EXIF:OffsetTimeOriginal=+02:00", "-EXIF:Make=Maker",
         "-EXIF:Model=Sphere 1", "-EXIF:FNumber=2.8", "-EXIF:GPSLatitude=52.5083", "-EXIF:GPSLatitudeRef=S",
         "-EXIF:GPSLongitude=13.25", "-EXIF:GPSLongitudeRef=E", "-EXIF:GPSAltitude=34.5", "-EXIF:GPSAltitudeRef=0",
         "-EXIF:GPSImgDirection=225", "-EXIF:GPSImgDirectionRef=T"});
  }
  void write_sphere(const std::string& name) const { write_picture(name, kSphereWide, kSphereHigh); }
};

/// A field by exiftool's name, its value before, and the commands whose results keep it.
struct Field {
  const char* name;
  Json before;
  bool convert, view, stitch;
};
const std::vector<Field>& fields() {
  static const std::vector<Field> all{{"ProjectionType", "equirectangular", true, false, true},
                                      {"PoseHeadingDegrees", 225, true, false, false},
                                      {"PosePitchDegrees", -24.5, true, false, false},
                                      {"PoseRollDegrees", 9, true, false, false},
                                      {"InitialViewHeadingDegrees", 30, true, false, false},
                                      {"GPSImgDirection", 225, true, false, false},
                                      {"GPSLatitude", -52.5083, true, true, true},
                                      {"GPSLongitude", 13.25, true, true, true},
                                      {"GPSAltitude", 34.5, true, true, true},
                                      {"DateTimeOriginal", "2024:05:06 07:08:09", true, true, true},
                                      {"OffsetTimeOriginal", "+02:00", true, true, true},
                                      {"Make", "Maker", true, true, true},
                                      {"Model", "Sphere 1", true, true, true},
                                      {"FNumber", 2.8, false, false, false}};
  return all;
}

bool is_same(const Json& before, const Json& after) {
  if (before.is_number()) return after.is_number() && std::abs(before.get<double>() - after.get<double>()) < 1e-5;
  return after.is_string() && after.get<std::string>().starts_with(before.get<std::string>());
}

TEST_F(MetadataCommand, EveryCommandFromEveryFormatToEveryFormat_KeepsWhatIsTrueOfTheResult) {
  std::printf("%-8s %-4s %-4s", "command", "from", "to");
  for (const Field& field : fields()) std::printf(" %s", field.name);
  std::printf("\n");
  for (const std::string from : {"jpg", "png", "tif"}) {
    write_picture("sphere." + from, kSphereWide, kSphereHigh);
    write_picture("head." + from, 96, 96);
    tag("head." + from, {"-n", "-EXIF:Orientation=6"});
    for (const Field& field : fields())
      ASSERT_TRUE(is_same(field.before, tags("sphere." + from)[field.name])) << from << " " << field.name;
    for (const std::string to : {"jpg", "png", "tif"}) {
      Words stitched{"stitch", path("six.json")};
      for (int h = 0; h < 6; ++h) stitched.push_back(path("head." + from));
      stitched.insert(stitched.end(), {"--width", "64"});
      const std::vector<std::pair<Words, bool Field::*>> commands{
          {{"convert", path("sphere." + from)}, &Field::convert},
          {{"view", path("sphere." + from), "--size", "64x48"}, &Field::view},
          {stitched, &Field::stitch}};
      for (auto [words, kept] : commands) {
        words.insert(words.end(), {"-o", path("o." + to)});
        const Finished done = nodal(words);
        ASSERT_EQ(done.code, 0) << done.err;
        const Json said = tags("o." + to);
        std::printf("%-8s %-4s %-4s", words[0].c_str(), from.c_str(), to.c_str());
        for (const Field& field : fields()) {
          const std::string what = words[0] + " " + from + " to " + to + " " + field.name;
          const bool present = said.contains(field.name);
          EXPECT_EQ(present, field.*kept) << what << said;
          EXPECT_TRUE(!present || is_same(field.before, said[field.name])) << what << said;
          std::printf(" %s", present ? "kept" : "-");
        }
        std::printf("\n");
        EXPECT_EQ(said.value("Warning", ""), "") << words[0] << from << to;
        EXPECT_EQ(said.value("Orientation", 1), 1) << "turned heads are not a turned sphere";
        EXPECT_TRUE(words[0] != "convert" || said.value("FullPanoWidthPixels", 0) == kSphereWide) << said;
      }
    }
  }
}

// A calibration and its report are of the rig, not of the place where it was measured.
TEST_F(MetadataCommand, RegisteringPictures_WritesNothingOfWhereAndWhenTheyWereTaken) {
  for (const std::string from : {"jpg", "png", "tif"}) {
    Words words{"register", path("six.json"),   "--free",   "light",
                "-o",       path("found.json"), "--report", path("found.html")};
    for (int h = 0; h < 6; ++h) {
      const std::string file = "head" + std::to_string(h) + "." + from;
      write_picture(file, 96, 96, 5 * h);  // heads with the same picture are refused
      const Json before = h == 0 ? tags(file) : Json();
      for (const Field& field : fields()) ASSERT_TRUE(h > 0 || is_same(field.before, before[field.name])) << file;
      words.push_back(path(file));
    }
    const Finished done = nodal(words);
    ASSERT_EQ(done.code, 0) << done.err;
    for (const std::string file : {"found.json", "found.html"}) {
      const Json said = tags(file);
      std::printf("%-8s %-4s %-4s", "register", from.c_str(), file.substr(6).c_str());
      for (const Field& field : fields()) {
        EXPECT_FALSE(said.contains(field.name)) << "register " << from << " to " << file << " " << field.name;
        std::printf(" %s", said.contains(field.name) ? "kept" : "-");
      }
      std::printf("\n");
      for (const char* text : {"52.508", "2024:05:06", "Sphere 1"}) {
        EXPECT_EQ(read(file).find(text), std::string::npos) << file << " from " << from << ": " << text;
      }
    }
  }
}

TEST_F(MetadataCommand, ByWayOfACube_ASphereKeepsItsPose) {
  write_sphere("in.jpg");
  ASSERT_EQ(nodal({"convert", path("in.jpg"), "--layout", "cube", "-o", path("cube.png")}).code, 0);
  EXPECT_FALSE(tags("cube.png").contains("ProjectionType")) << "viewers would take it for a sphere";
  ASSERT_EQ(nodal({"convert", path("cube.png"), "--from", "cube", "-o", path("back.jpg")}).code, 0);
  EXPECT_EQ(tags("back.jpg").value("PosePitchDegrees", 0.0), -24.5);
  EXPECT_EQ(tags("back.jpg").value("ProjectionType", ""), "equirectangular");
}

TEST_F(MetadataCommand, RaymapsOfARig_AreSpheresThatClaimNothingElse) {
  std::string toml = read("rig.toml");
  toml.insert(toml.find("[sim]"), "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n");
  write("rig.toml", toml);
  start_nodald();
  bring_up();
  ASSERT_EQ(nodal({"take", "start"}).code, 0);
  for (const std::string to : {"jpg", "png", "tif"}) {
    ASSERT_EQ(nodal({"raymap", "pull", "-o", path("live." + to)}).code, 0);
  }
  ASSERT_EQ(nodal({"take", "stop"}).code, 0);
  for (const std::string to : {"jpg", "png", "tif"}) {
    ASSERT_EQ(nodal({"render", path("takes/000001"), "-o", path("later-%d." + to)}).code, 0);
    for (const std::string& file : {"live." + to, "later-1." + to}) {
      const Json said = tags(file);
      EXPECT_EQ(said.value("ProjectionType", ""), "equirectangular") << file << said;
      EXPECT_EQ(said.value("FullPanoWidthPixels", 0), 256) << file << said;
      for (const char* key : {"PoseHeadingDegrees", "GPSLatitude", "GPSImgDirection", "DateTimeOriginal"})
        EXPECT_FALSE(said.contains(key)) << file << key;
    }
  }
}

/// Seconds since 1970 of a date as exiftool prints that of a Matroska file: "2026:11:27 10:11:12.25Z", in UTC.
double seconds_of(const std::string& date) {
  std::tm parts{};
  const char* const rest = ::strptime(date.c_str(), "%Y:%m:%d %H:%M:%S", &parts);
  if (rest == nullptr || !date.ends_with("Z")) return -1;
  const double fraction = *rest == '.' ? std::strtod(rest, nullptr) : 0;
  return static_cast<double>(::timegm(&parts)) + fraction;
}

// Films of heads show what a lens saw, those of raymaps spheres. All say when they were exposed, and nothing of where.
TEST_F(MetadataCommand, FilmsOfATake_SayWhatTheyShowAndWhen) {
  std::string toml = read("rig.toml");
  toml.insert(toml.find("[sim]"), "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n");
  write("rig.toml", toml);
  const std::time_t begun = std::time(nullptr);
  start_nodald();
  bring_up();
  ASSERT_EQ(nodal({"take", "start"}).code, 0);
  ASSERT_EQ(nodal({"raymap", "pull", "-n", "5", "-o", path("pulled.mkv")}).code, 0);
  ASSERT_EQ(nodal({"take", "stop"}).code, 0);
  ASSERT_EQ(nodal({"take", "export", path("takes/000001"), "--to", path("films")}).code, 0);
  ASSERT_EQ(nodal({"render", path("takes/000001"), "-o", path("rendered.mkv")}).code, 0);
  std::printf("%-18s %-10s %-11s %-16s\n", "film", "size", "projection", "exposed");
  for (const std::string film :
       {"films/cam0.mkv", "films/cam5.mkv", "films/raymaps.mkv", "rendered.mkv", "pulled.mkv"}) {
    const Json said = tags(film);
    const bool sphere = !film.starts_with("films/cam");
    const std::string size =
        std::to_string(said.value("ImageWidth", 0)) + "x" + std::to_string(said.value("ImageHeight", 0));
    const std::string date = said.value("DateTimeOriginal", "");
    std::printf("%-18s %-10s %-11s %-16s\n", film.c_str(), size.c_str(), sphere ? "sphere" : "-", date.c_str());
    // exiftool 12.57 reads no projection of Matroska. Element 7671 of one byte (RFC 9559): 1 is equirectangular.
    EXPECT_EQ(read(film).find("\x76\x71\x81\x01") != std::string::npos, sphere) << film;
    EXPECT_EQ(said.value("Warning", ""), "") << film;
    const double exposed = seconds_of(date);
    EXPECT_GE(exposed, static_cast<double>(begun) - 1) << film << said;
    EXPECT_LE(exposed, static_cast<double>(std::time(nullptr)) + 1) << film << said;
    for (const char* key : {"ProjectionPoseYaw", "PoseHeadingDegrees", "GPSLatitude", "Make"}) {
      EXPECT_FALSE(said.contains(key)) << film << key;
    }
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
