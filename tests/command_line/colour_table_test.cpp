// The chart through every command that makes pictures of pictures, from every kind of file: a table of the largest
// errors.
#include <gtest/gtest.h>
#include <tiff.h>
#include <turbojpeg.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>

#include "colour_chart.h"
#include "tests/support/pictures.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

/// How a file says what its numbers are.
struct Said {
  const char* name;
  Space space;
  bool tagged = true;  ///< by a profile; linear PNGs by gAMA
  bool grey = false;
  bool alpha = false;
};
const std::array<Said, 8> kSaid{{{"unsaid", kSrgbSpace, false},
                                 {"sRGB", kSrgbSpace},
                                 {"AdobeRGB", kAdobeRgb},
                                 {"DisplayP3", kDisplayP3},
                                 {"linear", kLinear},
                                 {"grey", kSrgbSpace, false, true},
                                 {"grey2.2", kGrey22, true, true},
                                 {"P3+alpha", kDisplayP3, true, false, true}}};
const std::array<std::string, 5> kFormats{"png8", "png16", "tif8", "tif16", "jpg"};

struct Form {
  const Said& said;
  const std::string& format;
  bool deep() const { return format.ends_with("16"); }
  bool coded() const { return format == "jpg"; }
  /// Linear numbers need 16 bits, and a JPEG has no alpha.
  bool possible() const { return (said.space.gamma != 1 || deep()) && !(said.alpha && coded()); }
  std::string file(const std::string& stem) const {
    return stem + "-" + said.name + "-" + format + "." + format.substr(0, 3);
  }
};

/// Calls body(form) for every kind of file that there is.
template <class Body>
void for_every_form(const Body& body) {
  for (const Said& said : kSaid) {
    for (const std::string& format : kFormats) {
      const Form form{said, format};
      if (form.possible()) body(form);
    }
  }
}

/// A JPEG's own samples, by libjpeg-turbo: rounding them to whole levels of luma and chroma changes them by up to 2
/// levels.
Bytes decoded(const Bytes& jpeg, int width, int height) {
  Bytes rgb(static_cast<std::size_t>(3 * width * height));
  const std::unique_ptr<void, int (*)(void*)> decoder(tjInitDecompress(), tjDestroy);
  EXPECT_EQ(tjDecompress2(decoder.get(), jpeg.data(), jpeg.size(), rgb.data(), width, 0, height, TJPF_RGB,
                          TJFLAG_ACCURATEDCT),
            0);
  return rgb;
}

/// Writes a picture in a form and returns what the file's samples are in sRGB, red, green and blue of 0 to 1.
std::vector<double> write_form(const std::string& file, Bytes rgb, int width, int height, const Form& form) {
  const Said& said = form.said;
  Bytes stored;
  for (std::size_t k = 0; k < rgb.size(); k += 3) {
    if (said.grey) rgb[k + 1] = rgb[k + 2] = rgb[k];
    stored.insert(stored.end(), &rgb[k], &rgb[k] + (said.grey ? 1 : 3));
    if (said.alpha) stored.push_back(128);
  }
  const int channels = (said.grey ? 1 : 3) + (said.alpha ? 1 : 0);
  const Bytes icc = said.tagged ? icc_of(said.space, said.grey) : Bytes();
  if (form.deep()) stored = deep_of(stored);
  if (form.coded()) {
    const auto sampling = said.grey ? test::Sampling::kGrey : test::Sampling::k444;
    const Bytes jpeg = test::jpeg_of(rgb, width, height, sampling, 100);
    test::write_bytes(file, icc.empty() ? jpeg : jpeg_with_profile(jpeg, icc));
    rgb = decoded(jpeg, width, height);
  } else if (form.format.starts_with("tif")) {
    write_tiff(file, stored,
               {.width = width,
                .height = height,
                .channels = channels,
                .bits = form.deep() ? 16 : 8,
                .alpha = said.alpha ? EXTRASAMPLE_UNASSALPHA : -1},
               icc);
  } else {
    const Bytes png = test::png_of(stored, width, height, channels, form.deep() ? 16 : 8);
    const bool linear = said.space.gamma == 1;
    test::write_bytes(file, linear        ? with_chunk(png, "gAMA", {0, 1, 0x86, 0xA0})
                            : icc.empty() ? png
                                          : with_profile(png, icc));
  }
  return by_definition(levels_of(rgb), said.space, kSrgbSpace);
}

class ColourTable : public ColourCommand {
 protected:
  /// Prints a row of the table. Allowed are rounding to 8 bits, and to luma and chroma where the result is a JPEG; with
  /// 16 bits on both sides a tenth of a level.
  void expect(const char* command, const Form& form, const std::string& to, double worst, double most) {
    std::printf("%-22s %-10s %-6s to %-6s largest error %6.2f of 255\n", command, form.said.name, form.format.c_str(),
                to.c_str(), 255 * worst);
    EXPECT_LT(255 * worst, most) << command << " " << form.said.name << " " << form.format << " to " << to;
  }
  static double most(const Form& form, const std::string& to) {
    if (to == "jpg") return 2.5;
    return form.deep() && to != "png8" ? 0.1 : 1.5;
  }
};

TEST_F(ColourTable, ConvertAndView_OfASphere) {
  for_every_form([&](const Form& form) {
    const std::string file = form.file("sphere");
    const std::vector<double> right = write_form(path(file), chart(), kWide, kHigh, form);
    for (const std::string to : {"png", "tif", "jpg"}) {
      // A linear picture of 16 bits stays so.
      std::vector<double> wanted = right;
      if (form.said.space.gamma == 1 && to != "jpg") wanted = levels_of(chart());
      run({"convert", path(file), "--from", "equirectangular", "-o", path("c." + to), "--quality", "100"});
      expect("convert", form, to, largest_error(samples("c." + to), wanted), most(form, to));
      run({"view", path(file), "--from", "equirectangular", "--camera", "equirectangular", "--fov", "360", "--size",
           "64x32", "-o", path("v." + to), "--quality", "100"});
      expect("view", form, to, largest_error(samples("v." + to), wanted), most(form, to));
    }
  });
}

constexpr int kHeadSide = 96, kHeadPatch = 24, kHeads = 6;

/// A head's part of the chart: four patches in the middle, and around them, where heads overlap, one grey.
Bytes head_chart(int head) {
  Bytes rgb;
  for (int y = 0; y < kHeadSide; ++y) {
    for (int x = 0; x < kHeadSide; ++x) {
      const int column = x / kHeadPatch - 1, row = y / kHeadPatch - 1;
      const bool middle = column >= 0 && column < 2 && row >= 0 && row < 2;
      const auto colour = chart_colour(middle ? 4 * head + 2 * row + column : kColours - 2);
      rgb.insert(rgb.end(), colour.begin(), colour.end());
    }
  }
  return rgb;
}

/// The largest error of a sphere in the middles of all heads' patches. `right`: samples of the heads' pictures.
double error_of_sphere(const std::vector<double>& sphere, int width, const std::vector<std::vector<double>>& right) {
  const Calibration rig = six_heads("six");
  const double focal = kHeadSide / 2.0 / std::tan(50 * std::numbers::pi / 180);
  double worst = 0;
  for (std::size_t h = 0; h < right.size(); ++h) {
    for (const int y : {36, 60}) {
      for (const int x : {36, 60}) {
        const std::array<double, 3> seen{(x - kHeadSide / 2.0) / focal, (y - kHeadSide / 2.0) / focal, 1};
        std::array<double, 3> ray{};
        for (std::size_t k = 0; k < 9; ++k) ray[k % 3] += rig.heads[h].R_head_rig[k] * seen[k / 3];
        const double yaw = std::atan2(ray[0], ray[2]), down = std::atan2(ray[1], std::hypot(ray[0], ray[2]));
        const int column = static_cast<int>((yaw / (2 * std::numbers::pi) + 0.5) * width);
        const int row = static_cast<int>((down / std::numbers::pi + 0.5) * width / 2);
        for (int c = 0; c < 3; ++c) {
          const double got = sphere.at(static_cast<std::size_t>(3 * (row * width + column) + c));
          worst = std::max(worst, std::abs(got - right[h].at(static_cast<std::size_t>(3 * (y * kHeadSide + x) + c))));
        }
      }
    }
  }
  return worst;
}

/// What a level in a JPEG is in sRGB, without any program: near the edge of sRGB a level of Adobe RGB or Display P3 is
/// several of sRGB. So the colours of a JPEG are compared with those of its own samples, which rounding has changed by
/// a level.
TEST(Jpeg, ALevelOfAWideSpace_IsSeveralLevelsOfSrgb) {
  for (const Space& space : {kSrgbSpace, kAdobeRgb, kDisplayP3}) {
    const Bytes colours = chart();
    const Bytes read = decoded(test::jpeg_of(colours, kWide, kHigh, test::Sampling::k444, 100), kWide, kHigh);
    int rounding = 0;
    for (std::size_t k = 0; k < read.size(); ++k) rounding = std::max(rounding, std::abs(colours[k] - read[k]));
    constexpr int kStep = 6;
    Bytes before, after;
    for (int k = 0; k < 42 * 42 * 42; ++k) {
      for (const int step : {k % 42, k / 42 % 42, k / 42 / 42}) {
        before.push_back(static_cast<std::uint8_t>(kStep * step));
        after.push_back(static_cast<std::uint8_t>(kStep * step + (before.size() % 3 == 1 ? 1 : 0)));
      }
    }
    const std::vector<double> from = by_definition(levels_of(before), space, kSrgbSpace);
    const std::vector<double> to = by_definition(levels_of(after), space, kSrgbSpace);
    double worst = 0;
    for (std::size_t k = 0; k < from.size(); ++k) worst = std::max(worst, 255 * std::abs(from[k] - to[k]));
    std::printf("JPEG of quality 100: samples %d of 255 off; one level of red in %-9s is up to %.2f levels of sRGB\n",
                rounding, space.name, worst);
    EXPECT_LE(rounding, 1);
    EXPECT_EQ(worst > 4, space.xy != kSrgbSpace.xy) << space.name;
  }
}

TEST_F(ColourTable, Stitch_OfHeads) {
  constexpr int kSphere = 256;
  Calibration rig = six_heads("srgb");
  for (HeadCalibration& head : rig.heads) head.response.curve = Response::Curve::kSrgb;
  write("srgb.json", to_json(rig));
  for_every_form([&](const Form& form) {
    Words words{"stitch", path("srgb.json")};
    std::vector<std::vector<double>> right, light;
    for (int h = 0; h < kHeads; ++h) {
      const std::string file = form.file("head" + std::to_string(h));
      right.push_back(write_form(path(file), head_chart(h), kHeadSide, kHeadSide, form));
      light.push_back(by_definition(right.back(), kSrgbSpace, kLinear));
      words.push_back(path(file));
    }
    words.insert(words.end(), {"--width", std::to_string(kSphere), "--quality", "100", "-o"});
    for (const std::string to : {"png8", "tif8", "jpg", "png16"}) {
      Words all = words;
      all.push_back(path("s." + to.substr(0, 3)));
      if (to == "png16") all.insert(all.end(), {"--bits", "16"});
      run(all);
      const bool linear = to == "png16";
      const double worst = error_of_sphere(samples("s." + to.substr(0, 3)), kSphere, linear ? light : right);
      expect("stitch", form, to, worst, to == "jpg" ? 2.5 : 1.5);
    }
  });
}

constexpr std::array<double, kHeads> kGains{1, 1.3, 0.8, 1.1, 0.9, 1.2};  // no sample is full
constexpr double kMiddleLight = 0.3;

/// What a head sees of a scene without edges, in sRGB's light.
std::vector<double> head_light(const HeadCalibration& head, double gain, bool grey) {
  const double focal = kHeadSide / 2.0 / std::tan(50 * std::numbers::pi / 180);
  std::vector<double> light;
  for (int y = 0; y < kHeadSide; ++y) {
    for (int x = 0; x < kHeadSide; ++x) {
      const std::array<double, 3> seen{(x + 0.5 - kHeadSide / 2.0) / focal, (y + 0.5 - kHeadSide / 2.0) / focal, 1};
      std::array<double, 3> ray{};
      for (std::size_t k = 0; k < 9; ++k) ray[k % 3] += head.R_head_rig[k] * seen[k / 3];
      const double length = std::hypot(ray[0], ray[1], ray[2]);
      for (std::size_t c = 0; c < 3; ++c) light.push_back(gain * (kMiddleLight + 0.1 * ray[grey ? 0 : c] / length));
    }
  }
  return light;
}

TEST_F(ColourTable, RegisterAndCalibrate_FindTheSameGainsInEveryForm) {
  Calibration rig = six_heads("srgb");
  for (HeadCalibration& head : rig.heads) head.response.curve = Response::Curve::kSrgb;
  write("srgb.json", to_json(rig));
  for_every_form([&](const Form& form) {
    Words given{"-o", path("lit.json"), path("srgb.json")};
    for (std::size_t h = 0; h < kHeads; ++h) {
      const std::string file = form.file("lit" + std::to_string(h));
      Bytes samples;
      const std::vector<double> light = head_light(rig.heads[h], kGains.at(h), form.said.grey);
      for (const double level : by_definition(light, kLinear, form.said.space)) {
        samples.push_back(static_cast<std::uint8_t>(std::lround(255 * level)));
      }
      write_form(path(file), samples, kHeadSide, kHeadSide, form);
      given.push_back(path(file));
    }
    for (const Words& command : {Words{"register"}, {"calibrate", "light"}}) {
      Words words = command;
      words.insert(words.end(), given.begin(), given.end());
      if (words[0] == "register") words.insert(words.end(), {"--free", "light", "--vignetting", "fixed"});
      run(words);
      const Calibration lit = parse_calibration(read("lit.json")).value();
      double mean = 0, worst = 0;  // gains have a common factor, which pictures do not determine
      for (std::size_t h = 0; h < kHeads; ++h) mean += std::log(lit.heads[h].gain[1] / kGains.at(h)) / kHeads;
      const std::vector<double> right = by_definition(std::vector<double>(3, kMiddleLight), kLinear, kSrgbSpace);
      for (std::size_t h = 0; h < kHeads; ++h) {
        std::vector<double> shown;
        for (const double gain : lit.heads[h].gain)
          shown.push_back(kMiddleLight * gain / kGains.at(h) / std::exp(mean));
        shown = by_definition(shown, kLinear, kSrgbSpace);
        for (std::size_t c = 0; c < 3; ++c) worst = std::max(worst, std::abs(shown[c] - right[c]));
      }
      expect(command.back().c_str(), form, "gains", worst, 1.5);
    }
  });
}

/// nodald, which has no colour management.
class ColourOfNodald : public ColourTable {
 protected:
  void write_rig(const std::string& heads, const std::string& sim) const {
    write("rig.toml",
          "[rig]\nname = \"six\"\nrate = \"25\"\n[raymap]\nwidth = 256\nheight = 128\nformat = "
          "\"RGB24\"\n[links]\nunix = \"nodal.sock\"\n"
          "[store]\nfolder = \"store\"\n[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n" +
              sim + heads);
  }
  static std::string heads(const std::string& port_begin, const std::string& port_end) {
    std::string all;
    for (int h = 0; h < kHeads; ++h) {
      const std::string n = std::to_string(h);
      all += "[[heads]]\nname = \"cam" + n + "\"\nformat = \"RGB24\"\nport = \"" + port_begin + n + port_end + "\"\n";
    }
    return all;
  }
  Finished check() const { return Process({NODAL_BIN_DIR "/nodald", "--check", "--config", path("rig.toml")}).wait(); }
  static bool in_srgb(const Form& form) { return form.said.space.gamma == 0 && form.said.space.xy == kSrgbSpace.xy; }
};

TEST_F(ColourOfNodald, PicturesInOtherSpaces_AreRefusedWithASentence) {
  for_every_form([&](const Form& form) {
    if (form.format.starts_with("tif")) return;  // nodald reads none
    for (const bool scene : {false, true}) {
      const std::string file = form.file(scene ? "scene" : "head0");
      write_form(path(file), scene ? chart() : head_chart(0), scene ? kWide : kHeadSide, scene ? kHigh : kHeadSide,
                 form);
      if (scene) {
        write_rig(heads("sim:cam", ""),
                  "[sim]\ncalibration = \"truth.json\"\nscene = \"photo\"\nphoto = \"" + file + "\"\n");
      } else {
        write_rig("[[heads]]\nname = \"cam0\"\nformat = \"RGB24\"\nport = \"replay:" + file + "\"\n", "");
      }
      const Finished done = check();
      EXPECT_EQ(done.code == 0, in_srgb(form)) << file << done.err;
      if (in_srgb(form)) continue;
      EXPECT_NE(done.err.find(file + "': is not in sRGB, as its "), std::string::npos) << done.err;
      EXPECT_NE(done.err.find("save it as sRGB"), std::string::npos) << done.err;
    }
  });
}

TEST_F(ColourOfNodald, AReplayOfTheChart_KeepsItsColoursToEveryOutlet) {
  for_every_form([&](const Form& form) {
    if (form.format.starts_with("tif") || !in_srgb(form)) return;
    std::vector<std::vector<double>> right;
    for (int h = 0; h < kHeads; ++h) {
      right.push_back(write_form(path("cam" + std::to_string(h) + ".pic"), head_chart(h), kHeadSide, kHeadSide, form));
    }
    write_rig(heads("replay:cam", ".pic"), "");
    fs::remove_all(path("takes"));
    fs::remove_all(path("store"));
    start_nodald();
    bring_up();
    constexpr double kAllowed = 1.5;
    run({"take", "start"});
    run({"raymap", "pull", "-n", "8", "--lossless", "-o", path("live-%d.png")});
    run({"take", "stop"});
    expect("raymap pull", form, "png8", error_of_sphere(samples("live-3.png"), 256, right), kAllowed);
    run({"render", path("takes/000001"), "-o", path("later-%d.png")});
    expect("render", form, "png8", error_of_sphere(samples("later-3.png"), 256, right), kAllowed);
    fs::remove_all(path("films"));
    run({"take", "export", path("takes/000001"), "--to", path("films")});
    if (Process({"sh", "-c", "command -v ffmpeg"}).wait().code != 0) return;
    const Finished played =
        Process({"ffmpeg", "-v", "error", "-y", "-i", path("films/cam5.mkv"), "-frames:v", "1", path("film.png")})
            .wait();
    ASSERT_EQ(played.code, 0) << played.err;
    const std::vector<double> film = samples("film.png");
    double worst = 0;
    for (const int at : {36 * kHeadSide + 36, 36 * kHeadSide + 60, 60 * kHeadSide + 36, 60 * kHeadSide + 60}) {
      for (std::size_t k = 3 * static_cast<std::size_t>(at); k < 3 * static_cast<std::size_t>(at) + 3; ++k) {
        worst = std::max(worst, std::abs(film.at(k) - right[5].at(k)));
      }
    }
    expect("take export", form, "film", worst, kAllowed);
  });
}

TEST_F(ColourOfNodald, APhotoScene_IsSeenInItsColours) {
  const Form form{kSaid[1], kFormats[0]};
  const std::vector<double> right = write_form(path("scene.png"), chart(), kWide, kHigh, form);
  Calibration rig = six_heads("truth");
  for (HeadCalibration& head : rig.heads) head.response.curve = Response::Curve::kSrgb;
  write("truth.json", to_json(rig));
  rig.name = "six";
  write("six.json", to_json(rig));
  write_rig(heads("sim:cam", ""), "[sim]\ncalibration = \"truth.json\"\nscene = \"photo\"\nphoto = \"scene.png\"\n");
  start_nodald();
  bring_up();
  run({"raymap", "pull", "-n", "3", "--lossless", "-o", path("live-%d.png")});
  run({"convert", path("live-2.png"), "--width", "64", "-o", path("small.png")});
  // Rows at the poles are seen by few pixels of a head, so their patches are left out.
  double worst = 0;
  const std::vector<double> got = samples("small.png");
  for (int y = kPatch + kPatch / 2; y < kHigh - kPatch; y += kPatch) {
    for (int x = kPatch / 2; x < kWide; x += kPatch) {
      for (int c = 0; c < 3; ++c) {
        const auto at = static_cast<std::size_t>(3 * (y * kWide + x) + c);
        worst = std::max(worst, std::abs(got.at(at) - right.at(at)));
      }
    }
  }
  expect("photo scene", form, "png8", worst, 2.5);
}

}  // namespace
}  // namespace nodal::command_line
