// How much of a scene each raymap layout keeps at an equal number of rays, as it is, as JPEG and as H.264.
//   build/release/bin/bench_layouts [--quick] [--only raw|jpeg|h264] [LAYOUT ...]    rows of JSON; tests/bench/layouts
//   makes the table and the plot of them
#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "detailed_scene.h"
#include "stitch/media/image_file.h"
#include "stitch/media/jpeg_writer.h"
#include "stitch/parallel/workers.h"
#include "stitch/view/camera.h"
#include "stitch/view/resampler.h"
#include "stitch/view/tangent.h"

namespace nodal::bench {
namespace {

using geometry::Ray;
using geometry::RaymapLayout;

constexpr int kViews = 16, kViewSide = 240;
constexpr double kViewFov = 50;  // degrees; 257 px/rad, finer than every raymap here
constexpr int kFine = 3;         // rays along each side of a pixel, whose mean the pixel is
constexpr int kFrames = 12;      // frames of a film
constexpr double kTurn = 0.005;  // rad from frame to frame: half a pixel of 131072 rays
constexpr double kJpegBits = 1;  // a ray
constexpr double kVideoBits = 0.25;

/// What is in front of the rig at a frame of the film: the scene, turned.
struct Moment {
  const DetailedScene& scene;
  Eigen::Matrix3d R_scene_rig;

  Moment(const DetailedScene& shown, int frame)
      : scene(shown),
        R_scene_rig(Eigen::AngleAxisd(kTurn * frame, Eigen::Vector3d(1, 2, 0.5).normalized()).toRotationMatrix()) {}
  double level(const Ray& ray) const { return scene.level(R_scene_rig * ray.direction()); }
};

/// Rays over the area of pixel (i, j), of the face that its own ray is in.
std::vector<Ray> rays_across(const RaymapLayout& layout, int i, int j) {
  std::vector<Ray> rays;
  const double angle = layout.solid_angle(i, j);
  const std::optional<Ray> own = angle > 0 ? layout.ray(i + 0.5, j + 0.5) : std::nullopt;
  if (!own) return rays;
  const view::Tangent tangent = view::tangent_at(*own);
  const double side = std::sqrt(angle);
  for (int k = 0; k < kFine * kFine; ++k) {
    const double dx = (k % kFine + 0.5) / kFine - 0.5, dy = (k / kFine + 0.5) / kFine - 0.5;
    const std::optional<Ray> ray =
        layout.scattered() ? Ray::towards(own->direction() + side * (dx * tangent.right + dy * tangent.down))
                           : layout.ray(i + 0.5 + dx, j + 0.5 + dy);
    if (!ray) continue;
    // Equirectangular pixels at the poles are up to half a row's circle long.
    const bool same_face = (ray->direction() - own->direction()).norm() < 2 * side || std::abs(own->y()) > 0.9;
    if (same_face) rays.push_back(*ray);
  }
  return rays;
}

DecodedImage raymap_of(const Moment& moment, const RaymapLayout& layout, const parallel::Workers& workers) {
  DecodedImage image{PixelFormat::kGrey8, layout.width(), layout.height(), {}};
  image.bytes.resize(packed_size(image.format, image.width, image.height));
  workers.run(layout.height(), [&](int j) {
    for (int i = 0; i < layout.width(); ++i) {
      const std::vector<Ray> rays = rays_across(layout, i, j);
      double sum = 0;
      for (const Ray& ray : rays) sum += moment.level(ray);
      const double mean = rays.empty() ? 0 : sum / static_cast<double>(rays.size());
      image.bytes[static_cast<std::size_t>(j) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(i)] =
          static_cast<std::uint8_t>(std::lround(mean));
    }
  });
  return image;
}

/// A view in a random direction and what it truly shows.
struct View {
  view::Camera camera;
  std::vector<float> levels;

  double psnr_weight(int x, int y) const {
    const double focal = kViewSide / 2.0 / std::tan(kViewFov * std::numbers::pi / 360);
    const double u = (x + 0.5 - kViewSide / 2.0) / focal, v = (y + 0.5 - kViewSide / 2.0) / focal;
    return std::pow(1 + u * u + v * v, -1.5);  // the pixel's solid angle
  }
};

std::vector<View> views_of(const Moment& moment, int count, const parallel::Workers& workers) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> even(-1, 1);
  std::vector<View> views;
  for (int k = 0; k < count; ++k) {
    view::CameraSpec spec;
    const double yaw = 180 * even(random), pitch = std::asin(even(random)) * 180 / std::numbers::pi;
    spec.pose = {yaw, pitch, 180 * even(random)};
    spec.fov_deg = kViewFov;
    spec.width = spec.height = kViewSide;
    views.push_back({view::Camera::make(spec).value(), std::vector<float>(kViewSide * kViewSide)});
  }
  workers.run(count * kViewSide, [&](int row) {
    View& view = views[static_cast<std::size_t>(row / kViewSide)];
    const int y = row % kViewSide;
    for (int x = 0; x < kViewSide; ++x) {
      double sum = 0;
      for (int k = 0; k < kFine * kFine; ++k) {
        sum += moment.level(*view.camera.ray(x + (k % kFine + 0.5) / kFine, y + (k / kFine + 0.5) / kFine));
      }
      view.levels[static_cast<std::size_t>(y * kViewSide + x)] = static_cast<float>(sum / (kFine * kFine));
    }
  });
  return views;
}

/// The views into raymaps of one layout, and how far they are from the truth.
class Viewer {
 public:
  Viewer(const RaymapLayout& layout, const parallel::Workers& workers)
      : workers_(workers), resampler_(layout, view::Filter::kBicubic, workers) {}

  /// The mean square error of views into one raymap, weighted by solid angle.
  double square(const DecodedImage& raymap, const std::vector<View>& views) const {
    double sum = 0, weight = 0;
    for (const View& view : views) {
      const view::Target target{kViewSide, kViewSide, [&](double x, double y) { return view.camera.ray(x, y); }, 0,
                                true};
      const DecodedImage shown = resampler_.resample(raymap.view(), target, workers_);
      for (int y = 0; y < kViewSide; ++y) {
        for (int x = 0; x < kViewSide; ++x) {
          const auto k = static_cast<std::size_t>(y * kViewSide + x);
          const double off = shown.bytes[k] - static_cast<double>(view.levels[k]), w = view.psnr_weight(x, y);
          sum += w * off * off, weight += w;
        }
      }
    }
    return sum / weight;
  }

 private:
  const parallel::Workers& workers_;
  view::Resampler resampler_;
};

double decibels(double square) { return 10 * std::log10(255.0 * 255.0 / square); }

/// Between two files, below and above the wanted size, by the logarithm of their sizes.
double at_size(double wanted, double less, double its_db, double more, double other_db) {
  if (more <= less) return its_db;
  const double part = std::clamp(std::log(wanted / less) / std::log(more / less), 0.0, 1.0);
  return its_db + part * (other_db - its_db);
}

double jpeg_db(const DecodedImage& raymap, const Viewer& viewer, const std::vector<View>& views, double bytes) {
  media::JpegWriter writer({raymap.format, raymap.width, raymap.height});
  std::vector<std::uint8_t> file;
  const auto size_at = [&](int quality) {
    writer.set_quality(quality);
    if (const Status written = writer.write(raymap.view(), "", file); !written) throw std::runtime_error("no JPEG");
    return static_cast<double>(file.size());
  };
  int low = 1, high = 100;
  while (high - low > 1) (size_at((low + high) / 2) <= bytes ? low : high) = (low + high) / 2;
  const auto db_at = [&](int quality) {
    size_at(quality);
    return decibels(viewer.square(media::decode_image(file, "jpeg", PixelFormat::kGrey8).value(), views));
  };
  return at_size(bytes, size_at(low), db_at(low), size_at(high), db_at(high));
}

/// A film coded by the ffmpeg program with x264, at the constant rate factor whose file has the wanted size.
class Coder {
 public:
  Coder() {
    std::string name = (std::filesystem::temp_directory_path() / "nodal-layouts-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    folder_ = name;
  }
  ~Coder() { std::filesystem::remove_all(folder_); }
  Coder(const Coder&) = delete;
  Coder& operator=(const Coder&) = delete;

  std::vector<DecodedImage> code(const std::vector<DecodedImage>& film, double bytes) {
    {
      std::ofstream raw(folder_ / "film.raw", std::ios::binary);
      const std::vector<char> grey(film.front().bytes.size() / 2, static_cast<char>(128));
      for (const DecodedImage& frame : film) {
        raw.write(reinterpret_cast<const char*>(frame.bytes.data()), std::ssize(frame.bytes));
        raw.write(grey.data(), std::ssize(grey));
      }
    }
    const DecodedImage& like = film.front();
    const std::string raw = " -f rawvideo -pix_fmt yuv420p ";  // from "gray", ffmpeg would change the range of values
    const std::string size = "-s " + std::to_string(like.width) + "x" + std::to_string(like.height) + " -r 25 -i ";
    double low = 1, high = 51;
    for (int trial = 0; trial < 10; ++trial) {
      const double factor = trial < 9 ? (low + high) / 2 : high;
      run(raw + size + at("film.raw") + " -c:v libx264 -preset medium -crf " + std::to_string(factor) + " -f h264 " +
          at("film.h264"));
      size_ = static_cast<double>(std::filesystem::file_size(folder_ / "film.h264"));
      (size_ > bytes ? low : high) = factor;
    }
    run(" -i " + at("film.h264") + raw + at("back.raw"));
    std::vector<DecodedImage> back(film.size(), DecodedImage{like.format, like.width, like.height, {}});
    std::ifstream read(folder_ / "back.raw", std::ios::binary);
    for (DecodedImage& frame : back) {
      frame.bytes.resize(like.bytes.size());
      if (!read.read(reinterpret_cast<char*>(frame.bytes.data()), std::ssize(frame.bytes)))
        throw std::runtime_error("ffmpeg gave too few frames");
      read.ignore(std::ssize(like.bytes) / 2);
    }
    return back;
  }
  double size() const { return size_; }  ///< bytes of the last film

 private:
  std::string at(const char* name) const { return (folder_ / name).string(); }
  static void run(const std::string& words) {
    const std::string command = "ffmpeg -nostdin -v error -y" + words;
    if (std::system(command.c_str()) != 0) throw std::runtime_error(command);
  }

  std::filesystem::path folder_;
  double size_ = 0;
};

int rays_of(const RaymapLayout& layout) {
  int rays = 0;
  for (int j = 0; j < layout.height(); ++j) {
    for (int i = 0; i < layout.width(); ++i) rays += layout.solid_angle(i, j) > 0 ? 1 : 0;
  }
  return rays;
}

/// The layout at the size with about `rays` rays.
std::unique_ptr<RaymapLayout> with_rays(const geometry::LayoutName& name, int rays) {
  const auto made = [&](double width) {
    const geometry::RaymapSize size = name.size_for_width(width);
    return geometry::make_layout(name, size.width, size.height).value();
  };
  const auto sample = made(250);  // its part of pixels with rays holds for other sizes
  const double step = name.kind().step.width, width = sample->width() * std::sqrt(1.0 * rays / rays_of(*sample));
  return made(std::round(width / step) * step);
}

struct Job {
  const char* scene_name;
  const DetailedScene& scene;
  const std::vector<View>& still;
  const std::vector<std::pair<int, std::vector<View>>>& filmed;
  const parallel::Workers& workers;
  std::string only;

  bool wants(std::string_view how) const { return only.empty() || only == how; }
};

void measure(const Job& job, const geometry::LayoutName& name, int rays, bool coded) {
  const auto layout = with_rays(name, rays);
  const int held = rays_of(*layout);
  const Viewer viewer(*layout, job.workers);
  const DecodedImage raymap = raymap_of(Moment(job.scene, 0), *layout, job.workers);
  const auto report = [&](const char* how, double bytes, double db) {
    const nlohmann::json row{{"scene", job.scene_name},
                             {"layout", name.text()},
                             {"width", layout->width()},
                             {"height", layout->height()},
                             {"rays", held},
                             {"aimed", rays},
                             {"as", how},
                             {"bytes", bytes},
                             {"db", db}};
    std::printf("%s\n", row.dump().c_str());
    std::fflush(stdout);
  };
  if (job.wants("raw")) report("raw", held, decibels(viewer.square(raymap, job.still)));
  if (!coded) return;
  const double jpeg_bytes = kJpegBits * rays / 8;
  if (job.wants("jpeg")) report("jpeg", jpeg_bytes, jpeg_db(raymap, viewer, job.still, jpeg_bytes));
  if (!job.wants("h264")) return;
  std::vector<DecodedImage> film;
  for (int frame = 0; frame < kFrames; ++frame) {
    film.push_back(raymap_of(Moment(job.scene, frame), *layout, job.workers));
  }
  Coder coder;
  const std::vector<DecodedImage> back = coder.code(film, kVideoBits * rays * kFrames / 8);
  double square = 0;
  for (const auto& [frame, views] : job.filmed) square += viewer.square(back[static_cast<std::size_t>(frame)], views);
  report("h264", coder.size(), decibels(square / static_cast<double>(job.filmed.size())));
}

void run(bool quick, const std::string& only, const std::vector<std::string>& layouts) {
  const parallel::Workers workers(0);
  const std::vector<int> sizes = quick ? std::vector<int>{8192} : std::vector<int>{32768, 131072, 524288};
  const int coded = quick ? 8192 : 131072;
  for (const auto& [name, detail] :
       {std::pair("everywhere", Detail::kEverywhere), std::pair("horizon", Detail::kHorizon)}) {
    const DetailedScene scene(detail);
    const std::vector<View> still = views_of(Moment(scene, 0), kViews, workers);
    std::vector<std::pair<int, std::vector<View>>> filmed;
    for (const int frame : {kFrames / 2, kFrames - 1}) {
      filmed.emplace_back(frame, views_of(Moment(scene, frame), kViews / 2, workers));
    }
    const Job job{name, scene, still, filmed, workers, only};
    for (const geometry::LayoutKind& kind : geometry::layout_kinds()) {
      if (kind.name == "central_cylinder" || kind.name == "mercator") continue;  // they hold no whole sphere
      if (!layouts.empty() && std::ranges::find(layouts, kind.name) == layouts.end()) continue;
      for (const int rays : sizes) {
        if (rays != coded && !job.wants("raw")) continue;
        measure(job, geometry::LayoutName::parse(kind.name).value(), rays, rays == coded);
      }
    }
  }
}

}  // namespace
}  // namespace nodal::bench

int main(int argc, char** argv) {
  CLI::App app("How much of a scene each raymap layout keeps");
  bool quick = false;
  std::string only;
  std::vector<std::string> layouts;
  app.add_flag("--quick", quick, "One small size");
  app.add_option("--only", only, "raw, jpeg or h264")->check(CLI::IsMember({"raw", "jpeg", "h264"}));
  app.add_option("LAYOUT", layouts, "Only these");
  CLI11_PARSE(app, argc, argv);
  try {
    nodal::bench::run(quick, only, layouts);
  } catch (const std::exception& wrong) {
    std::fprintf(stderr, "bench_layouts: %s\n", wrong.what());
    return 1;
  }
}
