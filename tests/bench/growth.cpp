#include "growth.h"

#include <fmt/format.h>

#include <cmath>
#include <compare>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <thread>

#include "frames.h"
#include "plot.h"
#include "stitch/table/table_compiler.h"
#include "tests/bench/workloads.h"

namespace nodal::bench {
namespace {

/// The parameters of one measurement; a sweep varies one of them.
struct Setting {
  int heads = 10;
  double heads_a_ray = 1.6;
  int width = 2048;
  int threads = 1;
  auto operator<=>(const Setting&) const = default;
};

/// One rig's frames and its tables, plain and with tone and gain.
struct Rig {
  explicit Rig(const Setting& setting) : work(spread(setting.heads, setting.heads_a_ray, setting.width)) {
    film = bench::film(work.rig, PixelFormat::kI420, 1);
    out = std::make_unique<Outputs>(PixelFormat::kI420, work.raymap.width, work.raymap.height);
    const std::vector<PixelFormat> formats(work.rig.heads.size(), PixelFormat::kI420);
    for (const bool light : {false, true}) {
      tables[light] = std::make_unique<blend::BlendTable>(
          table::compile_blend_table(work.rig, work.raymap, formats, options_of(light)).value());
      tones[light] = blend::calibrated_tone(*tables[light]);
      levels[light] = std::make_unique<Levels>(*tables[light]);
    }
    add_curves(tones[true]);
  }

  Workload work;
  FilmedSet film;
  std::unique_ptr<Outputs> out;
  std::array<std::unique_ptr<blend::BlendTable>, 2> tables;
  std::array<blend::SetTone, 2> tones;
  std::array<std::unique_ptr<Levels>, 2> levels;
};

struct Point {
  Setting setting;
  std::shared_ptr<Rig> rig;
  std::array<Times, 2> times;  ///< plain, with tone and gain

  double ms(bool light) const { return times[light].median_ms(); }
  void frame(bool light, std::size_t set, Pool& pool) {
    const blend::Pictures pictures = rig->levels[light]->make(rig->film.heads, pool);
    blend_frame(blend::kernels().back(), *rig->tables[light], pictures, rig->tones[light], rig->out->at(set), pool);
  }
};

/// The varied parameter, and how it is shown.
struct Sweep {
  std::string name;  ///< file name
  std::string title;
  std::string x_label;
  std::string x_unit;  ///< as used in the law
  std::string note;    ///< the constant parameters
  std::vector<Setting> settings;
  std::function<double(const Setting&)> x;
  bool inverse = false;  ///< whether the law is in 1 / x
};

double mpixels(const Setting& s) { return s.width * (s.width / 2.0) / 1e6; }

std::vector<Sweep> sweeps() {
  std::vector<Sweep> all;
  all.push_back({"pixels",
                 "Cost by output pixels",
                 "Mpixel of raymap",
                 "Mpixel",
                 "10 heads, whose pixels grow alike, 1.6 of them a ray, 1 thread",
                 {},
                 mpixels});
  for (const int width : {1024, 1536, 2048, 3072, 4096}) all.back().settings.push_back({.width = width});
  all.push_back({"overlap",
                 "Cost by overlap",
                 "heads that see a ray, mean",
                 "heads a ray",
                 "10 heads, 2048x1024, 1 thread; of 1.1 a ray some rays have none",
                 {},
                 [](const Setting& s) { return s.heads_a_ray; }});
  for (const double mean : {1.1, 1.6, 2.2, 3.0}) all.back().settings.push_back({.heads_a_ray = mean});
  all.push_back({"heads",
                 "Cost by heads, of equal coverage and as many pixels altogether",
                 "heads",
                 "heads",
                 "1.6 heads a ray, 2048x1024, 1 thread",
                 {},
                 [](const Setting& s) { return s.heads; }});
  for (const int heads : {2, 4, 8, 10, 16}) all.back().settings.push_back({.heads = heads});
  all.push_back({"threads",
                 "Cost by threads",
                 "threads",
                 "threads",
                 "10 heads, 1.6 a ray, 4096x2048; one thread by processor time, several by the clock",
                 {},
                 [](const Setting& s) { return s.threads; },
                 true});
  const int cores = std::max(2, static_cast<int>(std::thread::hardware_concurrency()));
  for (int threads = 1; threads <= cores; threads *= 2)
    all.back().settings.push_back({.width = 4096, .threads = threads});
  return all;
}

/// Settings that several sweeps share are measured once; settings that differ only in threads share a rig.
class Points {
 public:
  Point& at(const Setting& setting) {
    for (const auto& point : points_) {
      if (point->setting == setting) return *point;
    }
    Setting alone = setting;
    alone.threads = 1;
    std::shared_ptr<Rig> rig = setting == alone ? std::make_shared<Rig>(setting) : at(alone).rig;
    points_.push_back(std::make_unique<Point>(Point{setting, rig, {Times(setting.threads), Times(setting.threads)}}));
    return *points_.back();
  }

  /// Measures one frame of each point in turn: together they use more memory than the caches hold.
  void measure(int rounds) {
    std::map<int, std::unique_ptr<Pool>> pools;
    for (const auto& point : points_) {
      auto& pool = pools[point->setting.threads];
      if (!pool) pool = std::make_unique<Pool>(point->setting.threads);
    }
    for (int round = 0; round < rounds; ++round) {
      for (const bool light : {false, true}) {
        for (const auto& point : points_) {
          Pool& pool = *pools[point->setting.threads];
          point->times[light].take([&] { point->frame(light, static_cast<std::size_t>(round), pool); });
        }
      }
    }
  }

  void report(std::vector<Finding>& findings) const {
    for (const auto& point : points_) {
      const Setting& s = point->setting;
      for (const bool light : {false, true}) {
        Finding found{fmt::format("{} heads", s.heads),
                      fmt::format("{:g} a ray, {}{}", s.heads_a_ray, s.width, light ? ", light" : ""),
                      std::string(blend::kernel_name(blend::kernels().back())), s.threads, point->ms(light)};
        found.mpixels = mpixels(s);
        found.table_bytes_per_pixel = table_bytes(*point->rig->tables[light]) / (found.mpixels * 1e6);
        findings.push_back(found);
      }
    }
  }

 private:
  std::vector<std::unique_ptr<Point>> points_;
};

/// ms = a + b u by least squares, u = x or 1 / x.
struct Law {
  double a = 0, b = 0;
  bool inverse = false;
  double worst = 0;  ///< largest deviation relative to the measurement

  Law(const std::vector<PlotPoint>& points, bool in_inverse) : inverse(in_inverse) {
    const auto n = static_cast<double>(points.size());
    double u = 0, y = 0, uu = 0, uy = 0;
    for (const PlotPoint& p : points) {
      const double v = inverse ? 1 / p.x : p.x;
      u += v / n;
      y += p.y / n;
      uu += v * v / n;
      uy += v * p.y / n;
    }
    b = (uy - u * y) / (uu - u * u);
    a = y - b * u;
    for (const PlotPoint& p : points) worst = std::max(worst, std::abs(at(p.x) / p.y - 1));
  }
  double at(double x) const { return a + b * (inverse ? 1 / x : x); }
};

Plot draw(const Sweep& sweep, Points& points) {
  Plot plot{sweep.title,
            sweep.x_label,
            "ms a frame",
            fmt::format("I420 by {}; {}", blend::kernel_name(blend::kernels().back()), sweep.note),
            {}};
  for (const bool light : {false, true}) {
    PlotSeries series{light ? "tone + gain" : "plain", {}, {}, {}};
    for (const Setting& s : sweep.settings) series.points.push_back({sweep.x(s), points.at(s).ms(light)});
    const Law law(series.points, sweep.inverse);
    series.law = [law](double x) { return law.at(x); };
    series.law_text = fmt::format("ms = {:.3f} {} {:.4f} {} {}", law.a, law.b < 0 ? '-' : '+', std::abs(law.b),
                                  sweep.inverse ? '/' : 'x', sweep.x_unit);
    series.law_text +=
        series.points.size() > 2 ? fmt::format("; at most {:.1f} % off", 100 * law.worst) : "; through its two points";
    if (sweep.name == "heads") {
      const double eight = points.at({.heads = 8}).ms(light), sixteen = points.at({.heads = 16}).ms(light);
      series.law_text += fmt::format("; 16 cost {:+.1f} % on 8", 100 * (sixteen / eight - 1));
    }
    std::printf("growth, %s, %s: %s\n", sweep.name.c_str(), series.name.c_str(), series.law_text.c_str());
    plot.series.push_back(std::move(series));
  }
  return plot;
}

}  // namespace

bool measure_growth(const std::string& folder, bool quick, std::vector<Finding>& findings) {
  const std::vector<Sweep> all = sweeps();
  Points points;
  for (const Sweep& sweep : all) {
    for (const Setting& setting : sweep.settings) points.at(setting);
  }
  points.measure(quick ? 9 : 31);
  points.report(findings);
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  bool written = true;
  for (const Sweep& sweep : all) {
    std::ofstream file(std::filesystem::path(folder) / (sweep.name + ".svg"));
    file << to_svg(draw(sweep, points));
    file.close();
    written = written && file.good();
  }
  return written;
}

}  // namespace nodal::bench
