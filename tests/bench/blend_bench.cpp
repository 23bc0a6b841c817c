// blend_bench [--quick] [--json FILE] [--plots DIR]: compares the blend with OpenCV's best and with the memory
// bandwidth, on the reference workloads in one process: a frame of each variant in turn, over inputs beyond the caches.
#include <CLI/CLI.hpp>
#if defined(__x86_64__)
#include <immintrin.h>
#endif
#include <turbojpeg.h>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>

#include "frames.h"
#include "growth.h"
#include "measure.h"
#include "multi_band_peer.h"
#include "opencv_peer.h"
#include "report.h"
#include "stitch/blend/blend.h"
#include "stitch/blend/linear_tone.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/table/tone_compiler.h"
#include "tests/bench/workloads.h"
#include "tests/reference/double_blend.h"

namespace nodal::bench {
namespace {

constexpr int kBandRows = 64;

/// Lines that are written completely need not be read first.
void store_past_caches(std::uint8_t* to, std::uint64_t value) {
#if defined(__x86_64__)
  _mm_stream_si64(reinterpret_cast<long long*>(to), static_cast<long long>(value));
#else
  std::memcpy(to, &value, sizeof value);
#endif
}

struct Variant {
  Finding found;
  std::function<void(std::size_t set, Pool& pool)> frame;
  Times times{1};
  std::string peer = "OpenCV remap + blend";
};

/// A layout's size with about as many pixels as another raymap; faces are multiples of 16 pixels, as RIG.md advises.
geometry::RaymapSize size_for_pixels(const geometry::LayoutName& name, double pixels) {
  const geometry::RaymapSize large = name.size_for_width(4000);
  const double unit = 16.0 * name.kind().step.width;
  return name.size_for_width(unit * std::round(std::sqrt(pixels * large.width / large.height) / unit));
}

/// One workload with its variants.
class Course {
 public:
  Course(Workload work, bool quick) : work_(std::move(work)), quick_(quick), rounds_(quick ? 9 : 31) {
    heads_ = work_.rig.heads.size();
    layout_ = geometry::make_layout(work_.raymap.layout, work_.raymap.width, work_.raymap.height).value();
  }

  void run(std::vector<Finding>& findings) {
    add_peers();
    const geometry::RaymapLayout& own = *layout_;
    add_blends("plain", PixelFormat::kI420, PixelFormat::kI420, own, false);
    add_blends("seams of 1 degree", PixelFormat::kI420, PixelFormat::kI420, own, false, 0, Transition::kSeam);
    add_blends("two bands", PixelFormat::kI420, PixelFormat::kI420, own, false, 0, Transition::kTwoBand);
    add_blends("tone + gain", PixelFormat::kI420, PixelFormat::kI420, own, true);
    add_blends("the same, sharpened", PixelFormat::kI420, PixelFormat::kI420, own, true, table::TableOptions().sharpen);
    add_blends("YUYV read in place", PixelFormat::kYuyv, PixelFormat::kI420, own, false);
    add_blends("NV12 read in place", PixelFormat::kNv12, PixelFormat::kI420, own, false);
    add_blends("NV12 raymap", PixelFormat::kI420, PixelFormat::kNv12, own, false);
    add_blends("RGB", PixelFormat::kRgb24, PixelFormat::kRgb24, own, false);
    add_blends("RGB, 16 bits linear", PixelFormat::kRgb24, PixelFormat::kRgb48, own, false);
    const int side = static_cast<int>(std::sqrt(own.width() * own.height() / 6.0)) / 16 * 16;
    const auto cube = geometry::make_layout("cube", 3 * side, 2 * side).value();
    add_blends("cube of equal pixels", PixelFormat::kI420, PixelFormat::kI420, *cube, false);
    if (own.width() > 2048) {
      const auto small = geometry::make_layout("equirectangular", 2048, 1024).value();
      add_blends("minified to 2048x1024", PixelFormat::kI420, PixelFormat::kI420, *small, false);
    }
    const auto list = geometry::make_layout("hammersley", own.width(), own.height()).value();
    add_list_peer(*list);
    add_blends("Hammersley", PixelFormat::kI420, PixelFormat::kI420, *list, false);
    add_jpeg();
    measure();
    report(findings);
  }

  /// Every layout with about as many pixels as the workload's raymap, by the fastest kernel on one thread.
  void run_layouts(std::vector<Finding>& findings) {
    layouts_only_ = true;
    std::vector<double> rays;
    for (const geometry::LayoutKind& kind : geometry::layout_kinds()) {
      const geometry::LayoutName name = geometry::LayoutName::parse(kind.name).value();
      const auto [width, height] = size_for_pixels(name, 1.0 * work_.raymap.width * work_.raymap.height);
      const auto layout = geometry::make_layout(name, width, height).value();
      if (layout->scattered()) add_list_peer(*layout);
      add_blends(name.text(), PixelFormat::kI420, PixelFormat::kI420, *layout, false);
      double held = 0;
      for (int j = 0; j < height; ++j) {
        for (int i = 0; i < width; ++i) held += layout->ray(i + 0.5, j + 0.5) ? 1 : 0;
      }
      variants_.back().found.part_with_rays = held / width / height;
    }
    measure();
    report(findings);
  }

 private:
  void add(const std::string& variant, const std::string& isa, int threads, double pixels, double bytes,
           std::function<void(std::size_t, Pool&)> frame) {
    Variant v;
    v.found = {work_.name, variant, isa, threads, 0, 0, 0, 0, 0, bytes / pixels, pixels / 1e6};
    v.frame = std::move(frame);
    v.times = Times(threads);
    variants_.push_back(std::move(v));
  }

  const Films& films(PixelFormat format) {
    auto& made = films_[static_cast<std::size_t>(format)];
    if (!made) made = std::make_unique<Films>(work_.rig, format, heads_ > 8 ? 8 : 3);
    return *made;
  }

  void add_peers();
  void add_list_peer(const geometry::RaymapLayout& layout);
  void add_blends(const std::string& name, PixelFormat head_format, PixelFormat format,
                  const geometry::RaymapLayout& layout, bool light, int sharpen = 0,
                  Transition transition = Transition::kFeather);
  void add_jpeg();
  std::shared_ptr<blend::BlendTable> compile(const std::string& name, const geometry::RaymapLayout& layout,
                                             PixelFormat format, std::span<const PixelFormat> formats,
                                             const table::TableOptions& options);
  void judge(const blend::BlendTable& table, const geometry::RaymapLayout& layout, const Films& films,
             const table::TableOptions& options, Finding& found);
  void measure();
  void report(std::vector<Finding>& findings);

  Workload work_;
  bool quick_, layouts_only_ = false;
  int rounds_;
  std::size_t heads_ = 0;
  std::unique_ptr<geometry::RaymapLayout> layout_;
  std::array<std::unique_ptr<Films>, 8> films_;
  std::vector<std::shared_ptr<void>> kept_;
  std::vector<Variant> variants_;
  std::function<void(std::size_t, Pool&)> opencv_frame_, best_frame_;
  const Outputs* opencv_out_ = nullptr;
  const Outputs* best_out_ = nullptr;
};

void Course::add_peers() {
  const Films& input = films(PixelFormat::kI420);
  const int width = work_.raymap.width, height = work_.raymap.height;
  const double pixels = static_cast<double>(width) * height;
  auto out = std::make_shared<Outputs>(PixelFormat::kI420, width, height);
  kept_.push_back(out);
  const int bands = (height + kBandRows - 1) / kBandRows;
  for (const int threads : {1, 2}) {
    // Reads every byte of the heads once into a register, and writes every byte of the raymap once from one.
    add("roofline", "-", threads, pixels, 0, [&input, out, bands](std::size_t set, Pool& pool) {
      pool.run(bands, [&](int band) {
        std::array<std::uint64_t, 8> sum{};
        const auto share = [&](std::size_t bytes) {
          const auto b = static_cast<std::size_t>(band);
          const auto n = static_cast<std::size_t>(bands);
          return std::pair(bytes * b / n / 64 * 64, bytes * (b + 1) / n / 64 * 64);
        };
        for (const ImageView& head : input.at(set).heads) {
          const auto [from, to] = share(head.bytes);
          for (std::size_t i = from; i < to; i += 64) {
            std::array<std::uint64_t, 8> line;
            std::memcpy(&line, head.planes[0].data + i, 64);
            for (std::size_t k = 0; k < 8; ++k) sum[k] ^= line[k];
          }
        }
        const MutableImageView& raymap = out->at(set);
        const auto [from, to] = share(raymap.bytes);
        for (std::size_t i = from; i < to; i += 64) {
          for (std::size_t k = 0; k < 8; ++k) {
            store_past_caches(raymap.planes[0].data + i + 8 * k, sum[k]);
          }
        }
      });
    });
  }
  const std::vector<PixelFormat> formats(heads_, PixelFormat::kI420);
  const auto sampler =
      table::RaySampler::make(work_.rig, *layout_, PixelFormat::kI420, formats, options_of(false)).value();
  auto peer = std::make_shared<OpenCvPeer>(sampler, RaysAre::kInOrder);
  kept_.push_back(peer);
  opencv_frame_ = [&input, out, peer](std::size_t set, Pool& pool) {
    pool.run(peer->bands(), [&](int band) { peer->band(input.at(set).heads, out->at(set), band); });
  };
  opencv_out_ = out.get();
  for (const int threads : {1, 2})
    add("OpenCV remap + blend", "native", threads, pixels, peer->table_bytes(), opencv_frame_);
  auto multi_band = std::make_shared<MultiBandPeer>(sampler);
  kept_.push_back(multi_band);
  add("OpenCV MultiBandBlender", "native", 1, pixels, multi_band->table_bytes(),
      [&input, out, multi_band](std::size_t set, Pool&) { multi_band->blend(input.at(set).heads, out->at(set)); });
}

/// With two threads, as fast as they can.
std::shared_ptr<blend::BlendTable> Course::compile(const std::string& name, const geometry::RaymapLayout& layout,
                                                   PixelFormat format, std::span<const PixelFormat> formats,
                                                   const table::TableOptions& options) {
  constexpr int kRows = 4;
  Pool two(2);
  const double begin = clock_time_ms(), busy = process_time_ms();
  auto compiler = table::TableCompiler::make(work_.rig, layout, format, formats, options).value();
  const int rows = compiler.row_count();
  two.run((rows + kRows - 1) / kRows,
          [&](int k) { compiler.compile_rows(k * kRows, std::min(rows, (k + 1) * kRows)); });
  auto table = std::make_shared<blend::BlendTable>(std::move(compiler).finish().value());
  std::printf("%s, %s: table compiled in %.0f ms by two threads, which took %.0f ms of their cores\n",
              work_.name.c_str(), name.c_str(), clock_time_ms() - begin, process_time_ms() - busy);
  return table;
}

void Course::add_list_peer(const geometry::RaymapLayout& layout) {
  const Films& input = films(PixelFormat::kI420);
  const std::vector<PixelFormat> formats(heads_, PixelFormat::kI420);
  const auto sampler =
      table::RaySampler::make(work_.rig, layout, PixelFormat::kI420, formats, options_of(false)).value();
  auto out = std::make_shared<Outputs>(PixelFormat::kI420, layout.width(), layout.height());
  auto peer = std::make_shared<OpenCvPeer>(sampler, RaysAre::kInNoOrder);
  kept_.insert(kept_.end(), {out, peer});
  const std::string name = "OpenCV remap of the list, " + std::string(layout.name());
  for (const int threads : {1, 2}) {
    if (layouts_only_ && threads > 1) continue;
    add(name, "native", threads, static_cast<double>(layout.width()) * layout.height(), peer->table_bytes(),
        [&input, out, peer](std::size_t set, Pool& pool) {
          pool.run(peer->bands(), [&](int band) { peer->band(input.at(set).heads, out->at(set), band); });
        });
    variants_.back().peer = name;
  }
}

void Course::add_blends(const std::string& name, PixelFormat head_format, PixelFormat format,
                        const geometry::RaymapLayout& layout, bool light, int sharpen, Transition transition) {
  const int width = layout.width(), height = layout.height();
  table::TableOptions options = options_of(light);
  options.sharpen = sharpen;
  options.transition = transition;
  const std::vector<PixelFormat> formats(heads_, head_format);
  const auto table = compile(name, layout, format, formats, options);
  auto tone = std::make_shared<blend::SetTone>(blend::calibrated_tone(*table));
  if (is_linear16(format)) {
    const std::vector<blend::ExposedHead> alike(heads_);
    *tone = blend::linear_tone(*table, table::compile_tone_table(work_.rig, format), alike);
  }
  if (light) add_curves(*tone);
  auto out = std::make_shared<Outputs>(format, width, height);
  auto levels = std::make_shared<Levels>(*table);
  kept_.insert(kept_.end(), {table, tone, out, levels});
  const Films& input = films(head_format);
  const double pixels = static_cast<double>(width) * height;
  Finding judged;
  const bool judges = name == "plain" || layout.scattered() || light;
  if (!quick_ && !layouts_only_ && sharpen == 0 && judges) judge(*table, layout, input, options, judged);
  for (const blend::Kernel kernel : blend::kernels()) {
    if (kernel == blend::Kernel::kScalar && name != "plain") continue;
    if (layouts_only_ && kernel != blend::kernels().back()) continue;
    for (const int threads : {1, 2}) {
      if (layouts_only_ && threads > 1) continue;
      const auto frame = [=, &input](std::size_t set, Pool& pool) {
        const blend::Pictures pictures = levels->make(input.at(set).heads, pool);
        blend_frame(kernel, *table, pictures, *tone, out->at(set), pool);
      };
      add(name, std::string(blend::kernel_name(kernel)), threads, pixels, table_bytes(*table), frame);
      variants_.back().found.psnr_db = judged.psnr_db;
      variants_.back().found.max_error = judged.max_error;
      if (layout.scattered()) variants_.back().peer = "OpenCV remap of the list, " + std::string(layout.name());
      if (name == "plain" && kernel == blend::kernels().back()) {
        best_frame_ = frame;
        best_out_ = out.get();
      }
    }
  }
}

/// Compares a blended frame with the blend in double precision before rounding.
void Course::judge(const blend::BlendTable& table, const geometry::RaymapLayout& layout, const Films& films,
                   const table::TableOptions& options, Finding& found) {
  std::vector<std::uint8_t> memory(packed_size(table.format, table.width, table.height));
  const MutableImageView raymap = packed_image(table.format, table.width, table.height, memory.data());
  blend::blend_rows(table, films.at(0).heads, blend::calibrated_tone(table), raymap, 0, table.height);
  const std::vector<PixelFormat> formats(heads_, table.sources[0].format);
  const auto sampler = table::RaySampler::make(work_.rig, layout, table.format, formats, options).value();
  double squares = 0;
  double count = 0;
  const std::vector<test::RealPlane> real = test::blend_in_double(sampler, films.at(0).heads);
  for (std::size_t c = 0; c < real.size(); ++c) {
    for (std::size_t i = 0; i < real[c].values.size(); ++i) {
      if (!real[c].covered[i]) continue;
      const double error = raymap.planes[c].data[i] - std::clamp(real[c].values[i], 0.0, 255.0);
      squares += error * error;
      ++count;
      found.max_error = std::max(found.max_error, std::abs(error));
    }
  }
  found.psnr_db = 10 * std::log10(255.0 * 255.0 * count / squares);
}

void Course::add_jpeg() {
  const double pixels = static_cast<double>(work_.raymap.width) * work_.raymap.height;
  const auto coded = [pixels](const Outputs* out, const auto& frame) {
    std::shared_ptr<void> coder(tjInitCompress(), [](void* handle) { tjDestroy(handle); });
    auto jpeg = std::make_shared<std::vector<unsigned char>>(static_cast<std::size_t>(pixels) * 3);
    return [=](std::size_t set, Pool& pool) {
      frame(set, pool);
      const MutableImageView& raymap = out->at(set);
      const unsigned char* planes[] = {raymap.planes[0].data, raymap.planes[1].data, raymap.planes[2].data};
      unsigned char* to = jpeg->data();
      unsigned long bytes = jpeg->size();
      tjCompressFromYUVPlanes(coder.get(), planes, raymap.width, nullptr, raymap.height, TJSAMP_420, &to, &bytes, 85,
                              TJFLAG_NOREALLOC);
    };
  };
  add("OpenCV, then JPEG q85", "native", 1, pixels, 0, coded(opencv_out_, opencv_frame_));
  variants_.back().peer = "OpenCV, then JPEG q85";
  add("plain, then JPEG q85", std::string(blend::kernel_name(blend::kernels().back())), 1, pixels, 0,
      coded(best_out_, best_frame_));
  variants_.back().peer = "OpenCV, then JPEG q85";
}

void Course::measure() {
  Pool one(1), two(2);
  for (int round = 0; round < rounds_; ++round) {
    for (std::size_t v = 0; v < variants_.size(); ++v) {
      Variant& variant = variants_[v];
      if (variant.found.isa == "scalar" && round >= 5) continue;
      const auto set = static_cast<std::size_t>(round) * variants_.size() + v;
      Pool& pool = variant.found.threads == 1 ? one : two;
      variant.times.take([&] { variant.frame(set, pool); });
    }
  }
}

void Course::report(std::vector<Finding>& findings) {
  const auto ms_a_mpixel = [&](const std::string& name, int threads) {
    for (const Variant& v : variants_) {
      if (v.found.variant == name && v.found.threads == threads) return v.times.median_ms() / v.found.mpixels;
    }
    return 0.0;
  };
  for (Variant& v : variants_) {
    v.found.ms = v.times.median_ms();
    // For a raymap of another size OpenCV is assumed to need the same time per pixel.
    v.found.ratio_to_opencv = ms_a_mpixel(v.peer, v.found.threads) * v.found.mpixels / v.found.ms;
    const double whole = static_cast<double>(work_.raymap.width) * work_.raymap.height / 1e6;
    v.found.roofline_share = ms_a_mpixel("roofline", v.found.threads) * whole / v.found.ms;
    findings.push_back(v.found);
  }
}

}  // namespace
}  // namespace nodal::bench

int main(int argc, char** argv) {
  using namespace nodal::bench;
  CLI::App app("Measures the blend against OpenCV and against memory.");
  bool quick = false;
  std::string json;
  std::string only;
  app.add_flag("--quick", quick, "fewer frames, no accuracy");
  app.add_option("--json", json, "write the findings here, too");
  std::string plots;
  app.add_option("--plots", plots, "measure how cost grows, too, and draw it into this folder");
  app.add_option("--only", only, "r10, r8, growth (which needs --plots), or layouts: every layout of r10")
      ->check(CLI::IsMember({"r10", "r8", "growth", "layouts"}));
  CLI11_PARSE(app, argc, argv);
  if (only == "growth" && plots.empty()) {
    std::fprintf(stderr, "blend_bench: --only growth needs --plots DIR, the folder to draw into\n");
    return 1;
  }
  std::vector<Finding> findings;
  for (Workload work : {r10(), r8()}) {
    if (only.empty() || only == work.name) Course(std::move(work), quick).run(findings);
  }
  if (only == "layouts") {
    Course(r10(), quick).run_layouts(findings);
    print_layouts(findings);
  }
  if (!plots.empty() && (only.empty() || only == "growth") && !measure_growth(plots, quick, findings)) {
    std::fprintf(stderr, "blend_bench: the plots could not be written to %s: name a folder that may be written\n",
                 plots.c_str());
    return 1;
  }
  if (only != "layouts") print_table(findings);
  if (json.empty()) return 0;
  std::ofstream file(json);
  file << to_json(findings);
  return file.good() ? 0 : 1;
}
