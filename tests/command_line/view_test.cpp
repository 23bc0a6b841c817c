// `nodal convert` and `nodal view`, run as by a user.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <sstream>

#include "picture_command.h"
#include "stitch/media/image_file.h"
#include "tests/support/layouts.h"
#include "tests/support/pictures.h"

namespace nodal::command_line {
namespace {

class ViewCommand : public PictureCommand {
 protected:
  /// A smooth equirectangular raymap that does not jump at its left and right edge, without metadata.
  void write_sphere(const std::string& name, int width) const {
    std::vector<std::uint8_t> rgb;
    for (int y = 0; y < width / 2; ++y) {
      for (int x = 0; x < width; ++x) {
        const double theta = 6.2831853 * (x + 0.5) / width, phi = 6.2831853 * (y + 0.5) / width;
        for (const double k : {1.0, 2.0, 3.0}) {
          const double level = 128 + 100 * std::sin(phi) * std::sin(k * theta + k) * std::cos(k * phi);
          rgb.push_back(static_cast<std::uint8_t>(level));
        }
      }
    }
    test::write_bytes(path(name), test::png_of(rgb, width, width / 2, 3));
  }
};

TEST_F(ViewCommand, ThereAndBack_IsTheSameSphere_ForEveryLayoutOfTheWholeSphere) {
  write_sphere("sphere.png", 256);
  for (const geometry::LayoutKind& kind : geometry::layout_kinds()) {
    if (!test::holds_whole_sphere(kind)) continue;
    const std::string name(kind.name);
    const Json converted = nodal_json({"convert", path("sphere.png"), "--from", "equirectangular", "-o",
                                       path(name + ".png"), "--layout", name, "--width", "512"})
                               .at(0);
    EXPECT_EQ(converted["layout"], name);
    const Finished back =
        nodal({"convert", path(name + ".png"), "--from", name, "-o", path("back.png"), "--width", "256"});
    ASSERT_EQ(back.code, 0) << back.err;
    EXPECT_GT(psnr_of("sphere.png", "back.png"), name == "stratified_random" ? 34 : 40) << name;
  }
}

TEST_F(ViewCommand, Metadata_SaysWhatASphereIs_AndIsWrittenOnlyForOne) {
  write_sphere("bare.png", 128);
  expect_refused({"convert", path("bare.png"), "-o", path("out.png"), "--layout", "cube"},
                 "say its layout: --from equirectangular");
  ASSERT_EQ(nodal({"convert", path("bare.png"), "--from", "equirectangular", "-o", path("sphere.jpg")}).code, 0);
  EXPECT_NE(read("sphere.jpg").find("GPano"), std::string::npos);
  ASSERT_EQ(nodal({"convert", path("sphere.jpg"), "-o", path("cube.jpg"), "--layout", "cube"}).code, 0)
      << "its metadata says that it is equirectangular";
  EXPECT_EQ(read("cube.jpg").find("GPano"), std::string::npos);
  const Finished odd = nodal({"convert", path("sphere.jpg"), "-o", path("odd.jpg"), "--width", "333"});
  EXPECT_NE(odd.err.find("--width 333: the next width of this layout is 336"), std::string::npos) << odd.err;
  ASSERT_EQ(nodal({"view", path("sphere.jpg"), "-o", path("view.png"), "--size", "64x48"}).code, 0);
  EXPECT_EQ(read("view.png").find("GPano"), std::string::npos);
  const DecodedImage view = media::read_image(path("view.png"), PixelFormat::kRgb24).value();
  EXPECT_EQ(view.width, 64);
  EXPECT_EQ(view.height, 48);
}

TEST_F(ViewCommand, SeveralRaymaps_AreNumbered) {
  write_sphere("a.png", 64);
  write_sphere("b.png", 64);
  const Words words{"view", path("a.png"), path("b.png"), "--from", "equirectangular", "--size", "32x16"};
  Words numbered = words, one = words;
  numbered.insert(numbered.end(), {"-o", path("v-%02d.png")});
  one.insert(one.end(), {"-o", path("v.png")});
  ASSERT_EQ(nodal(numbered).code, 0);
  EXPECT_EQ(read("v-00.png"), read("v-01.png")) << "the same pictures";
  expect_refused(one, "%04d");
}

TEST_F(ViewCommand, Tiffs_AreReadAndKeepWhatTheySay) {
  write_sphere("bare.png", 128);
  ASSERT_EQ(nodal({"convert", path("bare.png"), "--from", "equirectangular", "-o", path("sphere.png")}).code, 0);
  ASSERT_EQ(nodal({"convert", path("bare.png"), "--from", "equirectangular", "-o", path("sphere.tif")}).code, 0);
  for (const std::string command : {"convert", "view"}) {
    Words same{command, "", "-o", ""};
    if (command == "view") same.insert(same.end(), {"--size", "64x48"});
    for (const std::string from : {"png", "tif"}) {
      same[1] = path("sphere." + from);  // its metadata says that it is equirectangular
      same[3] = path(command + "-" + from + ".png");
      const Finished run = nodal(same);
      ASSERT_EQ(run.code, 0) << run.err;
    }
    EXPECT_EQ(media::read_image(path(command + "-png.png")).value().bytes,
              media::read_image(path(command + "-tif.png")).value().bytes);
  }
}

TEST_F(ViewCommand, Of16Bits_StayOf16Bits_AsOtherProgramsReadThem) {
  constexpr int kWide = 256;
  std::vector<std::uint8_t> png_order, levels;  // upper byte first, and lower
  for (unsigned k = 0; k < kWide * kWide / 2 * 3; ++k) {
    const unsigned level = k * 40503U >> 3 & 0xffffU;  // nearly every one of 65536
    png_order.insert(png_order.end(), {static_cast<std::uint8_t>(level >> 8), static_cast<std::uint8_t>(level)});
    levels.insert(levels.end(), {static_cast<std::uint8_t>(level), static_cast<std::uint8_t>(level >> 8)});
  }
  test::write_bytes(path("deep.png"), test::png_of(png_order, kWide, kWide / 2, 3, 16));
  const auto convert = [&](const std::string& from, const std::string& to) {
    const Finished run = nodal({"convert", path(from), "--from", "equirectangular", "-o", path(to)});
    EXPECT_EQ(run.code, 0) << run.err;
  };
  convert("deep.png", "deep.tif");
  convert("deep.tif", "back.png");
  convert("deep.tif", "back.raw");
  EXPECT_EQ(media::read_image(path("back.png"), PixelFormat::kRgb48).value().bytes, levels)
      << "the same layout and size";
  const std::string raw = read("back.raw");
  EXPECT_EQ(std::vector<std::uint8_t>(raw.begin(), raw.end()), levels);
  convert("deep.png", "deep.jpg");
  EXPECT_EQ(read("back.png").find("gAMA"), std::string::npos) << "what the numbers mean is not known";
  ASSERT_TRUE(media::read_image(path("deep.jpg"))) << "of 8 bits";
  ASSERT_EQ(
      nodal({"view", path("deep.png"), "--from", "equirectangular", "-o", path("view.tif"), "--size", "64x48"}).code,
      0);
  if (Process({"sh", "-c", "command -v ffmpeg"}).wait().code != 0) GTEST_SKIP() << "ffmpeg is not installed";
  for (const std::string name : {"deep.tif", "back.png"}) {
    const auto peer = Process({"ffmpeg", "-v", "error", "-y", "-i", path(name), "-f", "rawvideo", "-pix_fmt", "rgb48le",
                               path("peer.raw")})
                          .wait();
    EXPECT_EQ(peer.code, 0) << peer.err;
    EXPECT_EQ(read("peer.raw"), raw) << name;
  }
  const std::string probe = "ffprobe -v error -show_entries stream=pix_fmt,width,height -of csv " + path("view.tif");
  EXPECT_NE(Process({"sh", "-c", probe}).wait().out.find("64,48,rgb48le"), std::string::npos);
}

TEST_F(ViewCommand, ATornPictureOf16Bits_IsOneSentence) {
  std::vector<std::uint8_t> samples;
  for (unsigned k = 0; k < 64 * 32 * 6; ++k) samples.push_back(static_cast<std::uint8_t>(k * 40503U >> 5));
  test::write_bytes(path("deep.png"), test::png_of(samples, 64, 32, 3, 16));
  ASSERT_EQ(nodal({"convert", path("deep.png"), "--from", "equirectangular", "-o", path("deep.tif")}).code, 0);
  for (const std::string name : {"deep.png", "deep.tif"}) {
    const std::string whole = read(name);
    test::write_bytes(path("cut-" + name),
                      {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(whole.size() / 2)});
    const Finished run = nodal({"convert", path("cut-" + name), "--from", "equirectangular", "-o", path("out.png")});
    EXPECT_NE(run.code, 0);
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
    EXPECT_NE(run.err.find("cut-" + name), std::string::npos) << run.err;
  }
}

TEST_F(ViewCommand, ATiffThatClaimsAThousandMillionPixels_IsOneSentenceAndTakesNoMemory) {
  // By the specification: 32768 x 32768 pixels of RGB in one strip, in a file of 1.1 MB.
  std::string tiff("II\x2a\0\x08\0\0\0\x08\0", 10);
  const auto entry = [&](unsigned tag, unsigned type, unsigned value) {
    for (const unsigned word : {tag | type << 16, 1U, value}) {
      for (int k = 0; k < 4; ++k) tiff += static_cast<char>(word >> (8 * k));
    }
  };
  entry(256, 4, 32768), entry(257, 4, 32768), entry(258, 3, 8), entry(259, 3, 1);
  entry(262, 3, 2), entry(273, 4, 110), entry(277, 3, 3), entry(279, 4, 1'100'000);
  tiff.resize(110 + 1'100'000);
  write("huge.tif", tiff);
  for (const std::string words : {"convert huge.tif --from cube -o out.png", "stitch huge.tif huge.tif -o out.png"}) {
    const Finished run =
        Process({"bash", "-c", "cd '" + path(".") + "' && ulimit -v 1000000 && " NODAL_BIN_DIR "/nodal " + words})
            .wait();
    EXPECT_NE(run.code, 0);
    EXPECT_NE(run.err.find("huge.tif': is 32768x32768, over the limit of 512 * 2^20 pixels"), std::string::npos)
        << run.err;
    EXPECT_EQ(run.err.find('\n'), run.err.size() - 1) << run.err;
  }
}

TEST_F(ViewCommand, WhatCannotBeDone_IsSaidInOneSentence) {
  write_sphere("sphere.png", 64);
  const std::string sphere = path("sphere.png");
  const auto refused = [&](const Words& more, const std::string& says) {
    Words words{"convert", sphere, "-o", path("out.png")};
    words.insert(words.end(), more.begin(), more.end());
    expect_refused(words, says);
    EXPECT_FALSE(std::filesystem::exists(path("out.png")));
  };
  refused({"--from", "cube"}, "63x42 would be");
  refused({"--from", "gnomonic"}, "there are: equirectangular, cube");
  refused({"--from", "equirectangular", "--layout", "cube:pad=99"}, "from 0 to 64");
  refused({"--from", "equirectangular", "--filter", "sinc"}, "nearest, bilinear, bicubic");
  expect_refused({"convert", sphere, "-o", sphere, "--from", "equirectangular"}, "is one of the pictures");
  expect_refused({"convert", path("gone.png"), "-o", path("out.png")}, "gone.png");
  write("text.png", "no picture");
  expect_refused({"convert", path("text.png"), "-o", path("out.png"), "--from", "cube"}, "text.png");
  expect_refused({"view", sphere, "-o", path("out.png"), "--from", "equirectangular", "--fov", "180"},
                 "a field of view of 180 degrees; the perspective camera shows 1 to 179");
  expect_refused({"view", sphere, "-o", path("out.png"), "--size", "64"}, "WIDTHxHEIGHT");
  expect_refused({"view", sphere, "-o", path("out.png"), "--camera", "pinhole"}, "perspective, fisheye");
  expect_refused({"view", sphere, "-o", path("out.png"), "--camera", "fisheye:f1=-1"}, "F1 from 1e-06");
  expect_refused({"view", sphere, "-o", path("out.png"), "--from", "equirectangular", "--camera", "fisheye:f3=-0.1",
                  "--fov", "210"},
                 "the fisheye:f3=-0.1 camera shows 1 to 209");
}

TEST_F(ViewCommand, EyeBesideTheCentreOfASphere_SeesWhatTheGeometryPredicts) {
  // From 3 m in front of the centre of a sphere of 5 m, the point at the right is at atan(4 / 3) = 53.13 degrees. The
  // camera there, turned to the right, shows in its middle what one at the centre shows when it is turned by that
  // angle.
  write_sphere("s.png", 512);
  const Words common{"--from", "equirectangular", "--fov", "2", "--size", "16x16"};
  const auto view = [&](Words words, const std::string& out) {
    words.insert(words.begin(), {"view", path("s.png"), "-o", path(out)});
    words.insert(words.end(), common.begin(), common.end());
    const Finished run = nodal(words);
    EXPECT_EQ(run.code, 0) << run.err;
  };
  view({"--yaw", "90", "--envelope", "sphere:5", "--eye", "0,0,3"}, "moved.png");
  view({"--yaw", "53.1301"}, "same.png");
  view({"--yaw", "90"}, "centre.png");
  EXPECT_GT(psnr_of("moved.png", "same.png"), 38);
  EXPECT_LT(psnr_of("moved.png", "centre.png"), 30);
}

TEST_F(ViewCommand, EyeOutsideOfASphere_SeesADiscOfTheSizeThatTheGeometryPredicts) {
  // A sphere of 1 m from 2 m away spans asin(1 / 2) = 30 degrees from its centre: a disc of the radius tan 30 / tan 45
  // of half the view's width.
  write_sphere("s.png", 64);
  const Finished run = nodal({"view", path("s.png"), "--from", "equirectangular", "-o", path("v.png"), "--envelope",
                              "sphere:1", "--eye", "0,0,-2", "--size", "100x100"});
  ASSERT_EQ(run.code, 0) << run.err;
  const DecodedImage view = media::read_image(path("v.png"), PixelFormat::kRgb24).value();
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 100; ++x) {
      const double off = std::hypot(x - 49.5, y - 49.5) - 50 * std::tan(std::acos(-1.0) / 6);
      const std::uint8_t* pixel = view.bytes.data() + 3 * (100 * y + x);
      if (std::abs(off) < 1) continue;
      EXPECT_EQ(pixel[0] + pixel[1] + pixel[2] > 0, off < 0) << x << " " << y;
    }
  }
}

TEST_F(ViewCommand, AListOfRays_IsALayoutOfItsOwn) {
  write_sphere("s.png", 128);
  // The golden spiral: even, and in no order of rows.
  std::string list = "rays 160 80  # width, height\n";
  for (int n = 0; n < 160 * 80; ++n) {
    const double y = 2 * (n + 0.5) / (160 * 80) - 1, theta = 2.399963229728653 * n, across = std::sqrt(1 - y * y);
    list += std::to_string(across * std::sin(theta)) + " " + std::to_string(y) + " " +
            std::to_string(across * std::cos(theta)) + "\n";
  }
  write("spiral.rays", list);
  const std::string layout = "rays:" + path("spiral.rays");
  const Json converted =
      nodal_json({"convert", path("s.png"), "--from", "equirectangular", "-o", path("r.png"), "--layout", layout})
          .at(0);
  EXPECT_EQ(converted["width"], 160);
  const std::string name = converted["layout"];
  EXPECT_EQ(name.size(), 21U) << name;
  const Finished back = nodal({"convert", path("r.png"), "--from", layout, "-o", path("back.png"), "--width", "128"});
  ASSERT_EQ(back.code, 0) << back.err;
  EXPECT_GT(psnr_of("s.png", "back.png"), 34);
  const Words view{"view", path("r.png"), "-o", path("v.png"), "--from"};
  const auto refused = [&](const std::string& from, const std::string& says) {
    Words words = view;
    words.push_back(from);
    expect_refused(words, says);
  };
  refused(name, "is not known here; give the file that has it: rays:FILE");
  refused("rays:" + path("gone.rays"), "gone.rays");
  write("small.rays", "rays 2 2\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n");
  refused("rays:" + path("small.rays"), "for raymaps of 2x2, not 160x80");
  write("twice.rays", "rays 2 2\n1 0 0\n0 1 0\n\n2 0 0\n1 1 1\n");
  refused("rays:" + path("twice.rays"), "line 5: the ray is the same as that of line 2");
  refused("rays:" + path("s.png"), "this is no list of rays");
}

TEST_F(ViewCommand, AMeshOfALayout_ShowsWhatTheLayoutShows) {
  write_sphere("s.png", 512);
  ASSERT_EQ(
      nodal({"convert", path("s.png"), "--from", "equirectangular", "-o", path("c.png"), "--layout", "cube:pad=2"})
          .code,
      0);
  const DecodedImage cube = media::read_image(path("c.png"), PixelFormat::kRgb24).value();
  const std::string size = std::to_string(cube.width) + "x" + std::to_string(cube.height);
  const Words view{"--yaw", "40", "--pitch", "30", "--size", "160x120"};
  const auto viewed = [&](Words words, const std::string& out) {
    words.insert(words.begin(), {"view", path("c.png"), "-o", path(out)});
    words.insert(words.end(), view.begin(), view.end());
    const Finished run = nodal(words);
    EXPECT_EQ(run.code, 0) << run.err;
  };
  viewed({"--from", "cube:pad=2"}, "rays.png");
  for (const std::string ending : {"obj", "glb", "mshp"}) {
    const std::string mesh = path("m." + ending);
    const Json made = nodal_json({"mesh", "--layout", "cube:pad=2", "--size", size, "-o", mesh}).at(0);
    EXPECT_LE(made["error_deg"].get<double>(), 0.1);
    viewed({"--mesh", mesh}, ending + ".png");
    EXPECT_GT(psnr_of("rays.png", ending + ".png"), 38) << ending;
  }
}

TEST_F(ViewCommand, AnMshpBox_IsReadByAReaderWrittenFromItsSpecification) {
  const std::string reader = NODAL_SOURCE_DIR "/tests/reference/mshp_reader.py";
  for (const auto& [layout, size] : {std::pair("cube", "96x64"), {"icosahedron", "128x44"}, {"hammersley", "40x20"}}) {
    for (const std::string ending : {"obj", "mshp"}) {
      ASSERT_EQ(nodal({"mesh", "--layout", layout, "--size", size, "-o", path("m." + ending)}).code, 0);
    }
    const auto compared = [&](const std::string& box) {
      const Finished run = Process({"/usr/bin/python3", reader, "compare", path(box), path("m.obj")}).wait();
      EXPECT_EQ(run.code, 0) << layout << ": " << run.err;
      std::istringstream words(run.out);
      std::size_t triangles = 0;
      double difference = 1;
      words >> triangles >> difference;
      EXPECT_GT(triangles, 0U);
      EXPECT_LT(difference, 1e-7) << "a float's rounding";
    };
    compared("m.mshp");
    ASSERT_EQ(Process({"/usr/bin/python3", reader, "deflate", path("m.mshp"), path("small.mshp")}).wait().code, 0);
    compared("small.mshp");
    if (std::string(layout) == "hammersley") continue;  // its raymap cannot be looked up between corners
    write_sphere("s.png", 64);
    for (const std::string box : {"m", "small"}) {
      const Finished run =
          nodal({"view", path("s.png"), "-o", path(box + ".png"), "--size", "64x48", "--mesh", path(box + ".mshp")});
      EXPECT_EQ(run.code, 0) << run.err;
    }
    EXPECT_EQ(read("m.png"), read("small.png"));
  }
}

TEST_F(ViewCommand, MeshesThatCannotBeMadeOrShown_AreRefusedInOneSentence) {
  write_sphere("s.png", 64);
  const std::string glb = path("m.glb");
  expect_refused({"mesh", "--size", "64x32", "-o", path("m.stl")}, "ends with .obj, .glb or .mshp");
  expect_refused({"mesh", "--size", "64", "-o", glb}, "write WIDTHxHEIGHT");
  expect_refused({"mesh", "--size", "64x33", "--layout", "cube", "-o", glb}, "--layout: a cube raymap is 3 by 2");
  expect_refused({"mesh", "--size", "64x32", "--error", "0.001", "-o", glb}, "--error: a mesh with this error");
  expect_refused({"mesh", "--size", "64x32", "--texture", "a.jpg", "-o", path("m.obj")}, "only a .glb");
  expect_refused({"mesh", "--size", "1024x512", "--layout", "halton", "-o", glb}, "give a smaller size");
  EXPECT_FALSE(std::filesystem::exists(glb));
  ASSERT_EQ(nodal({"mesh", "--size", "64x32", "-o", glb}).code, 0);
  const Words view{"view", path("s.png"), "-o", path("v.png"), "--mesh"};
  const auto with = [&](Words more) {
    more.insert(more.begin(), view.begin(), view.end());
    return more;
  };
  expect_refused(with({path("s.png")}), "ends with .obj, .glb or .mshp");
  expect_refused(with({path("gone.glb")}), "gone.glb");
  expect_refused(with({glb, "--camera", "fisheye"}), "only the perspective camera");
  expect_refused(with({glb, "--envelope", "sphere:1"}), "excludes");
  write("png.glb", read("s.png"));
  expect_refused(with({path("png.glb")}), "png.glb: it is no binary glTF");
}

TEST_F(ViewCommand, EnvelopesThatAreNone_AreRefusedInOneSentence) {
  write_sphere("s.png", 64);
  test::write_bytes(path("hole.obj"),
                    {'v', ' ', '0', ' ', '0', ' ', '1', '\n', 'f', ' ', '1', ' ', '1', ' ', '1', '\n'});
  const Words words{"view", path("s.png"), "--from", "equirectangular", "-o", path("v.png")};
  const auto with = [&](Words more) {
    more.insert(more.begin(), words.begin(), words.end());
    return more;
  };
  expect_refused(with({"--eye", "0,0,1"}), "--envelope");
  expect_refused(with({"--envelope", "sphere:5", "--eye", "0,0"}), "write X,Y,Z");
  expect_refused(with({"--envelope", "sphere:5", "--eye", "0,0,5"}), "the eye is on the surface");
  expect_refused(with({"--envelope", "sphere:x"}), "write sphere:RADIUS");
  expect_refused(with({"--envelope", "torus:1"}), "--envelope: no envelope is called 'torus'");
  expect_refused(with({"--envelope", path("none.obj")}), "none.obj");
  expect_refused(with({"--envelope", path("s.gltf")}), "ends with .obj or .glb");
  write("picture.glb", read("s.png"));
  expect_refused(with({"--envelope", path("picture.glb")}), "picture.glb: it is no binary glTF");
  expect_refused(with({"--envelope", path("hole.obj")}), "line 2");
}

}  // namespace
}  // namespace nodal::command_line
