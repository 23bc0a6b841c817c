// A raymap in an independent 360-degree viewer: pannellum in headless Chromium. Its picture is compared with the view
// that geometry gives for the same JPEG.
#include <gtest/gtest.h>
#include <png.h>
#include <turbojpeg.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <numbers>

#include "rig_process.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

struct Picture {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;
  double at(int x, int y, int channel) const {
    const int column = (x % width + width) % width;  // a sphere has no left end
    const int row = std::clamp(y, 0, height - 1);
    return rgb[static_cast<std::size_t>((row * width + column) * 3 + channel)];
  }
};

Picture decode_jpeg(const std::string& bytes) {
  Picture picture;
  const auto* data = reinterpret_cast<const unsigned char*>(bytes.data());
  tjhandle decoder = tjInitDecompress();
  int sampling = 0, colours = 0;
  tjDecompressHeader3(decoder, data, bytes.size(), &picture.width, &picture.height, &sampling, &colours);
  picture.rgb.resize(static_cast<std::size_t>(picture.width * picture.height * 3));
  tjDecompress2(decoder, data, bytes.size(), picture.rgb.data(), picture.width, 0, picture.height, TJPF_RGB, 0);
  tjDestroy(decoder);
  return picture;
}

Picture decode_png(const std::string& file) {
  Picture picture;
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_file(&image, file.c_str()) == 0) return picture;
  image.format = PNG_FORMAT_RGB;
  picture.width = static_cast<int>(image.width);
  picture.height = static_cast<int>(image.height);
  picture.rgb.resize(PNG_IMAGE_SIZE(image));
  png_image_finish_read(&image, nullptr, picture.rgb.data(), 0, nullptr);
  return picture;
}

struct View {
  double yaw = 0, pitch = 0;  // degrees, right and up
};
constexpr int kWidth = 640;
constexpr int kHeight = 480;

/// The sphere's value that a 90-degree pinhole looking along `view` sees at pixel (x, y), bilinear.
double expected(const Picture& sphere, View view, int x, int y, int channel) {
  const double degrees = std::numbers::pi / 180;
  const double right = x + 0.5 - kWidth / 2.0;
  const double down = y + 0.5 - kHeight / 2.0;
  const double ahead = kWidth / 2.0;  // tan 45 = 1
  const double cp = std::cos(view.pitch * degrees), sp = std::sin(view.pitch * degrees);
  const double level_down = down * cp - ahead * sp;  // positive pitch rotates the axis up, against "down"
  const double level_ahead = down * sp + ahead * cp;
  const double theta = std::atan2(right, level_ahead) + view.yaw * degrees;
  const double phi = std::atan2(level_down, std::hypot(right, level_ahead));
  const double u = (theta / (2 * std::numbers::pi) + 0.5) * sphere.width - 0.5;
  const double v = (phi / std::numbers::pi + 0.5) * sphere.height - 0.5;
  const int i = static_cast<int>(std::floor(u)), j = static_cast<int>(std::floor(v));
  const double a = u - i, b = v - j;
  return (1 - b) * ((1 - a) * sphere.at(i, j, channel) + a * sphere.at(i + 1, j, channel)) +
         b * ((1 - a) * sphere.at(i, j + 1, channel) + a * sphere.at(i + 1, j + 1, channel));
}

/// Only over the middle of the picture: pannellum draws its compass and logo at the edge.
double psnr(const Picture& shot, const Picture& sphere, View view) {
  double sum = 0;
  int count = 0;
  for (int y = 40; y < kHeight - 80; ++y) {
    for (int x = 40; x < kWidth - 80; ++x) {
      for (int c = 0; c < 3; ++c, ++count) {
        const double difference = shot.at(x, y, c) - expected(sphere, view, x, y, c);
        sum += difference * difference;
      }
    }
  }
  return 10 * std::log10(255.0 * 255.0 / (sum / count));
}

class Pannellum : public RigTest {
 protected:
  void SetUp() override {
    viewer_ = fs::path(NODAL_SOURCE_DIR) / "build/browser/node_modules/pannellum/build";
    if (!fs::exists(viewer_ / "pannellum.js") || std::system("command -v chromium >/dev/null") != 0) {
      GTEST_SKIP() << "chromium or pannellum is not here; tests/browser/fetch gets them";
    }
    // Larger than the rig of the other command line tests, so that the picture has detail.
    std::string toml = read("rig.toml");
    toml.replace(toml.find("width = 256"), 11, "width = 1024");
    toml.replace(toml.find("height = 128"), 12, "height = 512");
    write("rig.toml", toml);
    write("truth.json", to_json(six_heads("truth", 256)));
    write("six.json", to_json(six_heads("six", 256)));
    start_nodald();
    bring_up();
    ASSERT_EQ(nodal({"raymap", "pull", "--complete", "--out", path("raymap.jpg")}).code, 0);
  }

  Picture shot_of(View view) {
    for (const char* file : {"pannellum.js", "pannellum.css"}) {
      fs::copy_file(viewer_ / file, path(file), fs::copy_options::overwrite_existing);
    }
    // The page does not state the type: pannellum reads it from the file's GPano metadata.
    write("page.html",
          "<!doctype html><link rel=stylesheet href=pannellum.css><script src=pannellum.js></script>"
          "<style>html,body,#p{margin:0;width:640px;height:480px;overflow:hidden}</style><div id=p></div><script>"
          "pannellum.viewer('p',{panorama:'raymap.jpg',autoLoad:true,showControls:false,hfov:90,minPitch:-90,"
          "maxPitch:90,yaw:" +
              std::to_string(view.yaw) + ",pitch:" + std::to_string(view.pitch) + "})</script>");
    const Finished browser =
        Process({"chromium", "--headless", "--no-sandbox", "--allow-file-access-from-files", "--hide-scrollbars",
                 "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--window-size=640,480",
                 "--virtual-time-budget=8000", "--user-data-dir=" + path("profile"), "--screenshot=" + path("shot.png"),
                 "file://" + path("page.html")})
            .wait(std::chrono::seconds(100));
    EXPECT_EQ(browser.code, 0) << browser.err;
    return decode_png(path("shot.png"));
  }

 private:
  fs::path viewer_;
};

TEST_F(Pannellum, RaymapFromTheRig_IsSeenAsTheSphereItIs) {
  const Picture sphere = decode_jpeg(read("raymap.jpg"));
  ASSERT_EQ(sphere.width, 1024);
  for (const View view : {View{0, 0}, View{90, 0}, View{-150, 35}}) {
    const Picture shot = shot_of(view);
    ASSERT_EQ(shot.width, kWidth);
    ASSERT_EQ(shot.height, kHeight);
    if (const char* keep = std::getenv("NODAL_KEEP_SHOTS")) {
      fs::copy_file(path("shot.png"), fs::path(keep) / ("yaw" + std::to_string(static_cast<int>(view.yaw)) + ".png"),
                    fs::copy_options::overwrite_existing);
    }
    EXPECT_GT(psnr(shot, sphere, view), 30) << "yaw " << view.yaw << ", pitch " << view.pitch;
    // The same picture is very different from a view 20 degrees to the side.
    EXPECT_LT(psnr(shot, sphere, {view.yaw + 20, view.pitch}), 20);
  }
}

}  // namespace
}  // namespace nodal::command_line
