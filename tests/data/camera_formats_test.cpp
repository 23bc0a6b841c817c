// Raymaps from frames as cameras deliver them, beside raymaps from the same frames converted by ffmpeg, which also
// makes most of the frames, of pictures of the rendered town. Skipped where ffmpeg is not installed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "hal/sim/scene/scene.h"
#include "stitch/decode/jpeg_frame.h"
#include "stitch/sets/plan_job.h"
#include "stitch/sets/set_blend.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"
#include "tests/support/rendered_rig.h"

namespace nodal::data {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr int kSide = 240, kHeads = 6, kWidth = 512, kHeight = 256;

/// What ffmpeg needs to know of pixels.
struct Pixels {
  std::string format;  ///< its name
  ColourCoding coding{};
  int chroma_x = 0;  ///< place of the first chroma sample, 1/256 px right of the first luma sample
};
const Pixels kRgb{"rgb24"}, kI420{"yuv420p", {}, 128};

struct CameraFormat {
  const char* name;
  PixelFormat format;
  Pixels pixels;
  PixelFormat raymap;
  double least_luma, least_chroma;  ///< dB, of Nodal's raymap beside that of ffmpeg's pictures; of R G B the first
};

void PrintTo(const CameraFormat& format, std::ostream* to) { *to << format.name; }

class CameraFormats : public testing::TestWithParam<CameraFormat> {
 protected:
  void SetUp() override {
    if (test::Process({"sh", "-c", "command -v ffmpeg"}).wait().code != 0) GTEST_SKIP() << "ffmpeg is not installed";
  }

  /// All heads' frames of one format as another one.
  Bytes converted(const Bytes& frames, const Pixels& from, const Pixels& to) const {
    test::write_bytes(folder_ / "from", frames);
    std::vector<std::string> words{"ffmpeg", "-v", "error", "-y"};
    if (from.format.starts_with("yuvj")) {
      words.insert(words.end(), {"-f", "mjpeg"});
    } else {
      words.insert(words.end(), {"-f", "rawvideo", "-pix_fmt", from.format, "-s",
                                 std::to_string(kSide) + "x" + std::to_string(kSide)});
    }
    const auto side = [](const std::string& which, const Pixels& one) {
      return ":" + which + "_range=" + (one.coding.video_range ? "limited" : "full") + ":" + which +
             "_color_matrix=" + (one.coding.bt709 ? "bt709" : "bt601") + ":" + which +
             "_h_chr_pos=" + std::to_string(one.chroma_x) + ":" + which + "_v_chr_pos=128";
    };
    words.insert(words.end(), {"-i", (folder_ / "from").string(), "-fps_mode", "passthrough", "-vf",
                               "scale=flags=bicubic+accurate_rnd+full_chroma_int+full_chroma_inp" + side("in", from) +
                                   side("out", to) + ",format=" + to.format});
    if (to.format.starts_with("yuvj")) {
      words.insert(words.end(), {"-c:v", "mjpeg", "-q:v", "2", "-f", "mjpeg"});
    } else {
      words.insert(words.end(), {"-f", "rawvideo"});
    }
    words.push_back((folder_ / "to").string());
    const test::Finished done = test::Process(words).wait();
    EXPECT_EQ(done.code, 0) << done.err;
    return test::read_bytes(folder_ / "to");
  }

  /// Frames of equal size, or JPEGs, which begin with FF D8 FF and are found by it.
  static std::vector<std::span<const std::uint8_t>> taken_apart(const Bytes& frames, PixelFormat format) {
    std::vector<std::span<const std::uint8_t>> each;
    if (format != PixelFormat::kMjpeg) {
      const std::size_t bytes = packed_size(format, kSide, kSide);
      EXPECT_EQ(frames.size(), kHeads * bytes);
      for (std::size_t i = 0; i < kHeads; ++i) each.push_back(std::span(frames).subspan(i * bytes, bytes));
      return each;
    }
    constexpr std::array<std::uint8_t, 3> kBegin{0xFF, 0xD8, 0xFF};
    for (auto at = frames.begin(); at != frames.end();) {
      const auto next = std::search(at + 1, frames.end(), kBegin.begin(), kBegin.end());
      each.emplace_back(at, next);
      at = next;
    }
    EXPECT_EQ(each.size(), static_cast<std::size_t>(kHeads));
    return each;
  }

  Bytes raymap(const Bytes& frames, PixelFormat format, const ColourCoding& coding, PixelFormat of) const {
    RaymapConfig config;
    config.width = kWidth;
    config.height = kHeight;
    config.format = of;
    const std::vector<PixelFormat> formats(kHeads, format);
    auto job = sets::PlanJob::make(rig_, config, Fields::kProgressive, formats);
    if (!job) throw std::runtime_error(job.error().text());
    while (!job->tables().done()) job->tables().compile_some(1000);
    auto plan = std::move(*job).finish({});
    if (!plan) throw std::runtime_error(plan.error().text());
    sets::SetBlend blend;
    blend.adopt(sets::with_memory(std::move(*plan)));
    std::vector<sets::SetFrame> set(kHeads);
    const auto each = taken_apart(frames, format);
    for (std::size_t i = 0; i < kHeads; ++i) {
      set[i].present = true;
      set[i].exposure = Exposure::microseconds(1000);
      if (format == PixelFormat::kMjpeg) {
        set[i].image = {format, kSide, kSide, {}, each[i].size(), coding};
        set[i].image.planes[0] = {each[i].data(), static_cast<int>(each[i].size()), 1,
                                  static_cast<std::ptrdiff_t>(each[i].size()), 1};
      } else {
        set[i].image = packed_image(format, kSide, kSide, each[i].data());
        set[i].image.coding = coding;
      }
    }
    EXPECT_EQ(blend.begin(set), 0u);
    blend.run_rounds();
    for (const auto& decoded : blend.decoded()) EXPECT_EQ(decoded.fault, decode::DecodeFault::kNone);
    Bytes pixels(packed_size(of, kWidth, kHeight));
    blend.begin_raymap(0, pixels.data());
    blend.run_rounds();
    EXPECT_EQ(blend.heads(), (1u << kHeads) - 1);
    return pixels;
  }

  /// All heads' R G B pictures.
  const Bytes& town_pictures() const {
    static const Bytes kTown = [this] {
      Bytes all;
      for (const Bytes& head :
           test::render_rig(rig_, hal::sim::town_square_scene(), {.format = PixelFormat::kRgb24}).bytes)
        all.insert(all.end(), head.begin(), head.end());
      return all;
    }();
    return kTown;
  }

  const Calibration rig_ = test::six_fisheyes(kSide);
  test::TemporaryFolder folder_;
};

/// Planar 4:1:1 as IIDC cameras pack it.
Bytes packed_411(const Bytes& planar) {
  constexpr std::size_t kLuma = kSide * kSide, kChroma = kLuma / 4;
  Bytes packed;
  for (std::size_t at = 0; at < planar.size(); at += kLuma + 2 * kChroma) {
    for (std::size_t k = 0; k < kChroma; ++k) {
      const auto *y = &planar[at + 4 * k], *u = &planar[at + kLuma + k], *v = u + kChroma;
      packed.insert(packed.end(), {*u, y[0], y[1], *v, y[2], y[3]});
    }
  }
  return packed;
}

/// What a sensor behind a mosaic records of R G B pixels. ffmpeg reads mosaics, but makes none.
Bytes behind_mosaic(const Bytes& rgb, PixelFormat format) {
  const std::string name(pixel_format_name(format));  // the colours of the even row's two pixels, and of the odd row's
  Bytes mosaic;
  for (std::size_t at = 0; at < rgb.size(); at += 3) {
    const std::size_t x = at / 3 % kSide, y = at / 3 / kSide % kSide;
    mosaic.push_back(rgb[at + std::string("RGB").find(name[2 * (y % 2) + x % 2])]);
  }
  return mosaic;
}

TEST_P(CameraFormats, ARaymap_IsThatOfPicturesConvertedByFfmpeg) {
  const CameraFormat& camera = GetParam();
  const Bytes& town = town_pictures();
  const bool rgb = camera.raymap == PixelFormat::kRgb24;
  const bool bayer = is_bayer(camera.format);
  const Bytes frames = bayer ? behind_mosaic(town, camera.format) : converted(town, kRgb, camera.pixels);
  const Bytes by_ffmpeg = raymap(converted(frames, camera.pixels, rgb ? kRgb : kI420),
                                 rgb ? PixelFormat::kRgb24 : PixelFormat::kI420, {}, camera.raymap);
  const Bytes ours = raymap(camera.format == PixelFormat::kYuv411 ? packed_411(frames) : frames, camera.format,
                            camera.pixels.coding, camera.raymap);

  const auto luma = rgb ? static_cast<std::ptrdiff_t>(ours.size()) : std::ptrdiff_t{kWidth * kHeight};
  const double luma_psnr =
      test::psnr(Bytes(ours.begin(), ours.begin() + luma), Bytes(by_ffmpeg.begin(), by_ffmpeg.begin() + luma));
  const double chroma_psnr =
      rgb ? luma_psnr
          : test::psnr(Bytes(ours.begin() + luma, ours.end()), Bytes(by_ffmpeg.begin() + luma, by_ffmpeg.end()));
  std::printf(rgb ? "%-22s R G B %5.2f dB\n" : "%-22s Y %5.2f dB, U V %5.2f dB\n", camera.name, luma_psnr, chroma_psnr);
  EXPECT_GT(luma_psnr, camera.least_luma);
  EXPECT_GT(chroma_psnr, camera.least_chroma);
  if (!bayer) return;
  // How far each is from the town, of which the camera recorded less.
  const Bytes truth = raymap(town, PixelFormat::kRgb24, {}, camera.raymap);
  const double our_truth = test::psnr(ours, truth), its_truth = test::psnr(by_ffmpeg, truth);
  std::printf("%-22s to the town: Nodal %5.2f dB, ffmpeg %5.2f dB\n", "", our_truth, its_truth);
  EXPECT_GT(our_truth, its_truth);
}

constexpr ColourCoding kVideo{true, false}, kVideo709{true, true}, kFull709{false, true};
constexpr PixelFormat kYuvRaymap = PixelFormat::kI420, kRgbRaymap = PixelFormat::kRgb24;

INSTANTIATE_TEST_SUITE_P(
    Formats, CameraFormats,
    testing::Values(CameraFormat{"Yuyv", PixelFormat::kYuyv, {"yuyv422", {}, 0}, kYuvRaymap, 90, 41},
                    CameraFormat{"YuyvVideoRange", PixelFormat::kYuyv, {"yuyv422", kVideo, 0}, kYuvRaymap, 90, 41},
                    CameraFormat{"UyvyVideoBt709", PixelFormat::kUyvy, {"uyvy422", kVideo709, 0}, kYuvRaymap, 51, 41},
                    CameraFormat{"I422Bt709", PixelFormat::kI422, {"yuv422p", kFull709, 0}, kYuvRaymap, 51, 41},
                    CameraFormat{"Nv12VideoRange", PixelFormat::kNv12, {"nv12", kVideo, 128}, kYuvRaymap, 90, 90},
                    CameraFormat{"Yuv411", PixelFormat::kYuv411, {"yuv411p", {}, 0}, kYuvRaymap, 90, 43},
                    CameraFormat{"Mjpeg", PixelFormat::kMjpeg, {"yuvj420p", {}, 128}, kYuvRaymap, 60, 60},
                    CameraFormat{"MjpegToRgb", PixelFormat::kMjpeg, {"yuvj422p", {}, 128}, kRgbRaymap, 47, 0},
                    CameraFormat{"Rggb8", PixelFormat::kRggb8, {"bayer_rggb8"}, kRgbRaymap, 31, 0},
                    CameraFormat{"Grbg8", PixelFormat::kGrbg8, {"bayer_grbg8"}, kRgbRaymap, 31, 0},
                    CameraFormat{"Gbrg8", PixelFormat::kGbrg8, {"bayer_gbrg8"}, kRgbRaymap, 31, 0},
                    CameraFormat{"Bggr8", PixelFormat::kBggr8, {"bayer_bggr8"}, kRgbRaymap, 31, 0}),
    [](const auto& one) { return std::string(one.param.name); });

}  // namespace
}  // namespace nodal::data
