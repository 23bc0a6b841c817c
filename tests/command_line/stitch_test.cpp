// `nodal stitch` run as by a user, on pictures of a rendered rig; its pixels are compared with nodald's.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "stitch/geometry/raymap/layout.h"
#include "stitch/media/image_file.h"
#include "stitch_command.h"
#include "tests/support/pictures.h"
#include "tests/support/rendered_rig.h"

namespace nodal::command_line {
namespace {

/// Correlation of a whole sphere's green channel with the light of the town, weighted by solid angle. It is independent
/// of exposure, but not of noise, edges and walking people. Clipped areas are left out.
double correlation_with_town(const DecodedImage& sphere) {
  const auto layout = geometry::make_layout("equirectangular", sphere.width, sphere.height).value();
  const auto scene = hal::sim::town_square_scene(3);
  double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
  const std::uint8_t* green = sphere.bytes.data() + 1;
  for (int y = 0; y < sphere.height; ++y) {
    for (int x = 0; x < sphere.width; ++x, green += 3) {
      const geometry::Ray ray = *layout->ray(x + 0.5, y + 0.5);
      const double light = scene->light({ray.x(), ray.y(), ray.z()}, 2 * std::numbers::pi / sphere.width).g;
      if (light > 0.9) continue;
      const double level = *green;
      const double weight = layout->solid_angle(x, y);
      n += weight, a += weight * light, b += weight * level;
      aa += weight * light * light, bb += weight * level * level, ab += weight * light * level;
    }
  }
  EXPECT_GT(n, 0.9 * 4 * std::numbers::pi);
  return (ab - a * b / n) / std::sqrt((aa - a * a / n) * (bb - b * b / n));
}

TEST_F(StitchCommand, PicturesAndACalibration_GiveASphereThatShowsTheScene) {
  write_pictures("pictures");
  const Words words{"stitch", path("rig.json"), path("pictures"), "-o", path("sphere.png")};
  const Finished run = nodal(words);
  ASSERT_EQ(run.code, 0) << run.err;
  const DecodedImage sphere = media::read_image(path("sphere.png"), PixelFormat::kRgb24).value();
  // Equidistant: 160 px for 130 degrees are 70.5 px per radian, 443.1 px for the whole circle.
  EXPECT_EQ(sphere.width, 444);
  EXPECT_EQ(sphere.height, 222);
  EXPECT_GT(correlation_with_town(sphere), 0.95);

  std::filesystem::rename(path("pictures/cam1.png"), path("other"));
  std::filesystem::rename(path("pictures/cam3.png"), path("pictures/cam1.png"));
  std::filesystem::rename(path("other"), path("pictures/cam3.png"));
  ASSERT_EQ(nodal(words).code, 0);
  EXPECT_LT(correlation_with_town(media::read_image(path("sphere.png"), PixelFormat::kRgb24).value()), 0.9)
      << "two pictures are exchanged; a measure that does not see it is none";
}

TEST_F(StitchCommand, BestBlend_ShowsTheSceneAtLeastAsWell) {
  write_pictures("pictures");
  Words words{"stitch", path("rig.json"), path("pictures"), "-o", path("sphere.png")};
  Words board = words;
  board.insert(board.end(), {"--blend", "board"});
  ASSERT_EQ(nodal(board).code, 0);
  const double usual = correlation_with_town(media::read_image(path("sphere.png"), PixelFormat::kRgb24).value());
  ASSERT_EQ(nodal(words).code, 0);
  EXPECT_GT(correlation_with_town(media::read_image(path("sphere.png"), PixelFormat::kRgb24).value()), usual - 0.001);
}

TEST_F(StitchCommand, TwentyFourPictures_WithAndWithoutACalibration) {
  constexpr int kRingSide = 300;
  const test::RenderedRig rig = test::render_rig(test::three_rings(kRingSide, 80), hal::sim::town_square_scene(3),
                                                 {PixelFormat::kRgb24, 0.5, 5, 2});
  std::filesystem::create_directories(path("pictures"));
  for (std::size_t h = 0; h < rig.bytes.size(); ++h) {
    test::write_bytes(path("pictures/" + rig.truth.heads[h].name + ".png"),
                      test::png_of(rig.bytes[h], kRingSide, kRingSide, 3));
  }
  write("rig.json", to_json(rig.truth));
  const Words options{"--width", "640", "--blend", "board", "-o", path("sphere.png")};
  Words words{"stitch", path("rig.json"), path("pictures")};
  words.insert(words.end(), options.begin(), options.end());
  const Finished known = nodal(words);
  ASSERT_EQ(known.code, 0) << known.err;
  EXPECT_GT(correlation_with_town(media::read_image(path("sphere.png"), PixelFormat::kRgb24).value()), 0.95);

  words.erase(words.begin() + 1);
  const Finished alone = nodal(words);
  ASSERT_EQ(alone.code, 0) << alone.err;
  EXPECT_NE(alone.out.find("24 of 24 pictures placed"), std::string::npos) << alone.out << alone.err;
  const Calibration found = parse_calibration(read("sphere.rig.json")).value();
  Calibration truth = rig.truth;  // folders are read in the order of names
  std::ranges::sort(truth.heads, {}, &HeadCalibration::name);
  Calibration sorted = found;
  std::ranges::sort(sorted.heads, {}, &HeadCalibration::name);
  EXPECT_LT(test::rotation_error(truth, sorted).max_deg, 0.3);
}

TEST_F(StitchCommand, TheBoardAndTheCommand_MakeTheSameBytes) {
  write_pictures("pictures");
  std::string toml =
      "[rig]\nname = \"six\"\nrate = \"25\"\n[raymap]\nwidth = 256\nheight = 128\nformat = \"RGB24\"\n"
      "[links]\nunix = \"nodal.sock\"\n[store]\nfolder = \"store\"\n[trigger]\nstart = true\n";
  for (std::size_t h = 0; h < town().bytes.size(); ++h) {
    toml += "[[heads]]\nname = \"" + name_of(h) + "\"\nformat = \"RGB24\"\nport = \"replay:pictures/" + name_of(h) +
            ".png\"\n";
  }
  write("rig.toml", toml);
  start_nodald();
  ASSERT_EQ(nodal({"calibration", "upload", path("rig.json")}).code, 0);
  const Finished pulled = nodal({"raymap", "pull", "--out", path("board.raw")});
  ASSERT_EQ(pulled.code, 0) << pulled.err;
  for (const char* threads : {"1", "3"}) {
    const Finished run = nodal({"stitch", path("rig.json"), path("pictures"), "--blend", "board", "--width", "256",
                                "--threads", threads, "-o", path("here.raw")});
    ASSERT_EQ(run.code, 0) << run.err;
    EXPECT_EQ(read("here.raw").size(), 256U * 128 * 3);
    EXPECT_TRUE(read("here.raw") == read("board.raw")) << threads << " threads";
  }
}

TEST_F(StitchCommand, SeveralFolders_GiveARaymapEach) {
  write_pictures("0001");
  write_pictures("0002");
  const Words words{"stitch", path("rig.json"), path("0001"), path("0002"), "--width", "64", "-o", path("s-%02d.jpg")};
  ASSERT_EQ(nodal(words).code, 0);
  EXPECT_TRUE(std::filesystem::exists(path("s-00.jpg")));
  EXPECT_EQ(read("s-00.jpg"), read("s-01.jpg")) << "the same pictures";
  EXPECT_NE(read("s-00.jpg").find("GPano"), std::string::npos) << "viewers know it as a sphere by this";
  expect_refused({path("rig.json"), path("0001"), path("0002"), "-o", path("one.jpg")}, "%04d");
  EXPECT_FALSE(std::filesystem::exists(path("one.jpg")));
}

TEST_F(StitchCommand, AFolderForEachHead_IsItsSequence) {
  write_pictures("set");
  Words words{"stitch", path("rig.json")};
  for (std::size_t h = town().truth.heads.size(); h-- > 0;) {  // the order does not matter
    std::filesystem::create_directories(path("film/" + name_of(h)));
    for (const char* frame : {"0001.png", "0002.png", "0003.png"}) {
      std::filesystem::copy_file(path("set/" + name_of(h) + ".png"), path("film/" + name_of(h) + "/" + frame));
    }
    words.push_back(path("film/" + name_of(h) + "/"));
  }
  Words all = words;
  all.insert(all.end(), {"--width", "64", "-o", path("f-%d.png")});
  const Finished run = nodal(all);
  ASSERT_EQ(run.code, 0) << run.err;
  ASSERT_EQ(nodal({"stitch", path("rig.json"), path("set"), "--width", "64", "-o", path("one.png")}).code, 0);
  for (const char* file : {"f-0.png", "f-1.png", "f-2.png"}) EXPECT_EQ(read(file), read("one.png")) << file;
  EXPECT_FALSE(std::filesystem::exists(path("f-3.png")));
  std::filesystem::remove(path("film/" + name_of(2) + "/0003.png"));
  Words uneven(words.begin() + 1, words.end());
  uneven.insert(uneven.end(), {"-o", path("f-%d.png")});
  expect_refused(uneven, name_of(2));
}

TEST_F(StitchCommand, ALayout_HasTheSizeThatSuitsIt) {
  write_pictures("pictures");
  const auto size_of = [&](const Words& more) {
    Words words{"stitch", path("rig.json"), path("pictures"), "-o", path("out.png")};
    words.insert(words.end(), more.begin(), more.end());
    const Json answer = nodal_json(words).at(0);
    return std::pair(answer["width"].get<int>(), answer["height"].get<int>());
  };
  EXPECT_EQ(size_of({"--layout", "cube"}), std::pair(426, 284)) << "70.5 px a radian in the middle of a face 2 wide";
  EXPECT_EQ(size_of({"--layout", "cube", "--width", "60"}), std::pair(60, 40));
  EXPECT_EQ(size_of({"--width", "101"}), std::pair(104, 52)) << "the next that halved chroma fits into";
  EXPECT_EQ(size_of({"--width", "100", "--bits", "16"}), std::pair(100, 50));
}

TEST_F(StitchCommand, EveryLayout_IsMade) {
  write_pictures("pictures");
  for (const geometry::LayoutKind& kind : geometry::layout_kinds()) {
    const std::string name(kind.name);
    const Json answer = nodal_json({"stitch", path("rig.json"), path("pictures"), "--blend", "board", "--layout", name,
                                    "--width", "60", "-o", path(name + ".png")})
                            .at(0);
    EXPECT_EQ(answer["layout"], name);
    const DecodedImage picture = media::read_image(path(name + ".png"), PixelFormat::kRgb24).value();
    EXPECT_EQ(answer["width"], picture.width) << name;
    EXPECT_EQ(read(name + ".png").find("GPano") != std::string::npos, name == "equirectangular") << name;
    const auto layout = geometry::make_layout(name, picture.width, picture.height).value();
    // The same place of the scene, wherever the layout puts it: close to what the equirectangular raymap shows there.
    const DecodedImage sphere = media::read_image(path("equirectangular.png"), PixelFormat::kRgb24).value();
    const auto flat = geometry::make_layout("equirectangular", sphere.width, sphere.height).value();
    double sum = 0, count = 0;
    for (int y = 0; y < picture.height; ++y) {
      for (int x = 0; x < picture.width; ++x) {
        const std::optional<geometry::Ray> ray = layout->ray(x + 0.5, y + 0.5);
        if (!ray || layout->solid_angle(x, y) == 0) continue;
        const geometry::Pixel at = flat->pixel(*ray).value();
        const int i = std::min(static_cast<int>(at.x), sphere.width - 1),
                  j = std::min(static_cast<int>(at.y), sphere.height - 1);
        const auto level = [](const DecodedImage& image, int column, int row) {
          return static_cast<double>(image.bytes[static_cast<std::size_t>(3 * (row * image.width + column) + 1)]);
        };
        sum += std::abs(level(picture, x, y) - level(sphere, i, j));
        count += 1;
      }
    }
    EXPECT_LT(sum / count, 20) << name << ": differences of a pixel's width, and of filters";
  }
}

/// Two fisheyes of 190 degrees back to back, with picture circles at different positions.
test::RenderedRig two_fisheyes() {
  Calibration rig = test::six_fisheyes(kSide, 190);
  rig.heads = {rig.heads[0], rig.heads[2]};
  const Region::Circle circles[] = {{76, 83, 70}, {82, 79, 74}};
  for (std::size_t h = 0; h < 2; ++h) {
    HeadCalibration& head = rig.heads[h];
    head.name = "cam" + std::to_string(h);
    head.region.circle = circles[h];
    head.center_x = circles[h].x;
    head.center_y = circles[h].y;
    head.max_angle = 95 * std::numbers::pi / 180;
    head.lens = EquidistantLens{{circles[h].radius / head.max_angle}};
  }
  test::RenderedRig rendered = test::render_rig(rig, hal::sim::town_square_scene(3), {PixelFormat::kRgb24, 0, 5, 3});
  for (std::size_t h = 0; h < 2; ++h) {  // outside its circle the lens leaves the sensor dark
    for (int i = 0; i < kSide * kSide; ++i) {
      const double from_middle = std::hypot(i % kSide + 0.5 - circles[h].x, i / kSide + 0.5 - circles[h].y);
      if (from_middle < circles[h].radius) continue;
      std::fill_n(rendered.bytes[h].begin() + std::ptrdiff_t{3} * i, 3, std::uint8_t{2});
    }
  }
  return rendered;
}

TEST_F(StitchCommand, ARigByItsDataSheet_IsStitchedWithTheCirclesFoundInThePictures) {
  const test::RenderedRig rig = two_fisheyes();
  std::filesystem::create_directories(path("pictures"));
  for (std::size_t h = 0; h < 2; ++h) {
    test::write_bytes(path("pictures/cam" + std::to_string(h) + ".png"), test::png_of(rig.bytes[h], kSide, kSide, 3));
  }
  const auto stitched = [&](Words more) {
    Words words{"stitch", "--nominal", "2x190", "-o", path("sphere.png"), path("pictures")};
    words.insert(words.end(), more.begin(), more.end());
    const Finished run = nodal(words);
    EXPECT_EQ(run.code, 0) << run.err;
    return correlation_with_town(media::read_image(path("sphere.png"), PixelFormat::kRgb24).value());
  };
  const double found = stitched({});
  const double given = stitched({"--circle", "76,83,70", "--circle", "82,79,74"});
  EXPECT_GT(given, 0.9);
  EXPECT_GT(found, given - 0.01);
  EXPECT_LT(stitched({"--circle", "80,80,80"}), given - 0.02) << "one circle for both is wrong here";
  expect_refused(
      {"--nominal", "2x190", path("pictures"), "--circle", "1,1,5", "--circle", "1,1,5", "--circle", "1,1,5"},
      "3 circles for 2 heads");
  expect_refused({"--nominal", "3x190", path("pictures")}, "no picture of head 'cam2'");
  expect_refused({"--circle", "1,1,5", path("pictures")}, "--nominal");
}

TEST_F(StitchCommand, PicturesAlone_GiveTheSphereAndTheCalibration) {
  constexpr int kFineSide = 400;
  const test::RenderedRig rig =
      test::render_rig(test::six_fisheyes(kFineSide), hal::sim::town_square_scene(3), {PixelFormat::kRgb24, 1.0, 5, 2});
  std::filesystem::create_directories(path("own"));
  for (std::size_t h = 0; h < rig.bytes.size(); ++h) {
    test::write_bytes(path("own/" + rig.truth.heads[h].name + ".png"),
                      test::png_of(rig.bytes[h], kFineSide, kFineSide, 3));
  }
  write("own/notes.txt", "not a picture");
  const Json answer = nodal_json({"stitch", path("own"), "--width", "512", "-o", path("town.png")}).at(0);
  EXPECT_EQ(answer["placed"], 6);
  EXPECT_EQ(answer["given"], 6);
  EXPECT_GT(answer["points"], 50);
  EXPECT_LT(answer["median_px"], 1);
  EXPECT_EQ(answer["verdict"], "good") << answer["seams"];
  EXPECT_EQ(answer["report"], path("town.report.html"));
  EXPECT_NE(answer["confidence"].get<std::string>().find("6 of 6 pictures placed"), std::string::npos) << answer;
  EXPECT_NE(answer["confidence"].get<std::string>().find("half of them agree within"), std::string::npos) << answer;
  EXPECT_GT(answer["lens"]["seen_deg"][1], answer["lens"]["seen_deg"][0]) << answer;
  EXPECT_TRUE(std::filesystem::exists(path("town.report.html")));
  const auto found = parse_calibration(read("town.rig.json"));
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_EQ(found->heads[0].name, rig.truth.heads[0].name) << "heads are called after their files";
  EXPECT_EQ(found->name, name_of(0) + ", " + name_of(1) + " and 4 more") << "and the calibration after the first ones";
  EXPECT_LT(test::rotation_error(rig.truth, *found).max_deg, 0.3);
  // The calibration that was written makes the same picture.
  Words again{"stitch", path("town.rig.json"), path("own"), "--width", "512", "-o", path("again.png")};
  ASSERT_EQ(nodal(again).code, 0);
  EXPECT_EQ(read("again.png"), read("town.png"));

  // `register` finds in pictures alone what `stitch` finds in them.
  const Finished same = nodal({"register", path("own"), "-o", path("same.json")});
  ASSERT_EQ(same.code, 0) << same.err;
  EXPECT_EQ(read("same.json"), read("town.rig.json"));
  EXPECT_NE(same.out.find("pitch"), std::string::npos) << "says where heads look: " << same.out;

  // A disk that is too small for the sphere has no report of it either.
  under_ = {"prlimit", "--fsize=1000000"};
  EXPECT_NE(nodal({"stitch", path("own"), "--width", "2048", "-o", path("large.png")}).code, 0);
  under_.clear();
  EXPECT_FALSE(std::filesystem::exists(path("large.png")));
  EXPECT_FALSE(std::filesystem::exists(path("large.report.html")));

  const Finished run =
      nodal({"register", path("own"), "--free", "lens", "-o", path("rig.json"), "--rig-toml", path("rig.toml")});
  ASSERT_EQ(run.code, 0) << run.err;
  const auto registered = parse_calibration(read("rig.json"));
  ASSERT_TRUE(registered) << registered.error().text();
  EXPECT_LT(test::rotation_error(rig.truth, *registered).max_deg, 0.3);
  EXPECT_NE(read("rig.toml").find("port = \"replay:own/" + name_of(0) + ".png\""), std::string::npos)
      << read("rig.toml");
}

TEST_F(StitchCommand, PicturesAloneThatDoNotFit_AreRefused) {
  write_pictures("pictures");
  std::filesystem::create_directories(path("empty"));
  expect_refused({path("pictures/" + name_of(0) + ".png"), "-o", path("x.jpg")}, "is one picture, and no two circles");
  expect_refused({path("pictures"), path("empty"), "-o", path("x.jpg")}, "there is no picture in this folder");
  expect_refused({path("pictures"), path("nothing.jpg"), "-o", path("x.jpg")}, "nothing.jpg");
  expect_refused({path("pictures"), "-o", path("pictures/" + name_of(0) + ".png")}, "is one of the pictures");
  // Opposite heads of a narrow field of view have nothing in common.
  test::write_bytes(path("a.png"), test::png_of(std::vector<std::uint8_t>(64 * 64 * 3, 90), 64, 64, 3));
  test::write_bytes(path("b.png"), test::png_of(std::vector<std::uint8_t>(64 * 64 * 3, 70), 64, 64, 3));
  expect_refused({path("a.png"), path("b.png"), "-o", path("x.jpg")}, "no two pictures show the same things");
  EXPECT_FALSE(std::filesystem::exists(path("x.jpg")));
  EXPECT_FALSE(std::filesystem::exists(path("x.rig.json")));
}

TEST_F(StitchCommand, WhatCannotBeDone_IsSaidInOneSentence) {
  write_pictures("pictures");
  const std::string rig = path("rig.json");
  const std::string pictures = path("pictures");
  expect_refused({rig}, "give one for each of the 6 heads");
  expect_refused({rig, pictures + "/cam0.png"}, "1 picture for 6 heads");
  expect_refused({path("gone.json"), pictures}, "gone.json");
  expect_refused({rig, path("gone.png")}, "gone.png");
  expect_refused({rig, pictures, "-o", path("out.tga")}, "end it in .jpg, .png, .tif or .raw");
  expect_refused({rig, pictures, "--bits", "16", "-o", path("out.jpg")}, "a JPEG has 8 bits");
  expect_refused({rig, pictures, "--layout", "gnomonic"}, "equirectangular, cube");
  expect_refused({rig, pictures, "--width", "40000"}, "--width");
  const std::string before = read("pictures/cam2.png");
  expect_refused({rig, pictures, "-o", pictures + "/../pictures/cam2.png"}, "cam2.png is one of the pictures");
  EXPECT_EQ(read("pictures/cam2.png"), before);
  expect_refused({rig, pictures, "--seam-width", "181"}, "--seam-width");
  expect_refused({rig, pictures, "--seam-width", "nan"}, "--seam-width");
  expect_refused({rig, pictures, "--transition", "cut"}, "--transition");
  expect_refused({rig, pictures, "--quality", "better"}, "from 1 to 100");
  expect_refused({rig, pictures, "--quality", "best", "--feather", "0.2"}, "--feather: --blend best");
  expect_refused({rig, pictures, "--quality", "best", "--blend", "board"}, "--blend: --quality best is an older word");
  expect_refused({rig, pictures, "-o", path("no/such/folder/out.jpg")}, "no/such/folder");
  test::write_bytes(path("pictures/cam3.png"), test::png_of(std::vector<std::uint8_t>(64 * 64 * 3), 64, 64, 3));
  expect_refused({rig, pictures, "-o", path("out.jpg")}, "cam3.png: the picture has 64x64 pixels");
  write("pictures/cam3.png", "no picture");
  expect_refused({rig, pictures, "-o", path("out.jpg")}, "cam3.png");
  write("project.pto", "neither");
  expect_refused({path("project.pto"), pictures}, "project.pto");
  EXPECT_FALSE(std::filesystem::exists(path("out.jpg")));
}

}  // namespace
}  // namespace nodal::command_line
