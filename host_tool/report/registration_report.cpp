#include "host_tool/report/registration_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "host_tool/console/quantities.h"
#include "host_tool/report/html_report.h"
#include "host_tool/report/pictured_heads.h"
#include "host_tool/report/sphere_graph.h"
#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/geometry/head.h"
#include "stitch/media/jpeg_writer.h"
#include "stitch/media/png_writer.h"
#include "stitch/parallel/workers.h"

namespace nodal::host {
namespace {

using geometry::Head;
using geometry::Ray;
using registration::FrameSet;
using registration::Report;

constexpr int kMapWidth = 768, kMapHeight = 384;
constexpr int kColourWidth = 1152, kColourHeight = 576;
constexpr int kClose = 288;   // side of a close-up, px
constexpr int kChecker = 36;  // side of a square from one head, px
constexpr std::size_t kSeams = 6;
constexpr double kDifferenceStretch = 8;  // a difference of 32 levels is shown white

// Calls `row` with every row of a picture of the whole sphere and a function that gives the ray of a column.
template <class Row>
void for_rows(int width, int height, const Row& row) {
  parallel::Workers(0).run(height, [&](int y) {
    row(static_cast<std::size_t>(y), [=](std::size_t x) {
      return Ray::at({((static_cast<double>(x) + 0.5) / width - 0.5) * 2 * std::numbers::pi,
                      ((y + 0.5) / height - 0.5) * std::numbers::pi});
    });
  });
}

struct Spheres {
  std::vector<std::uint8_t> difference, seers;
};

Spheres spheres_of(const PicturedHeads& rig) {
  Spheres spheres;
  spheres.difference.resize(std::size_t{kMapWidth} * kMapHeight);
  spheres.seers.resize(spheres.difference.size());
  for_rows(kMapWidth, kMapHeight, [&](std::size_t y, const auto& ray_at) {
    for (std::size_t x = 0; x < kMapWidth; ++x) {
      const Ray ray = ray_at(x);
      double sum = 0, squares = 0, count = 0;
      for (std::size_t h = 0; h < rig.heads().size(); ++h) {
        const std::optional<double> light = rig.light(h, ray);
        if (!light) continue;
        sum += *light;
        squares += *light * *light;
        ++count;
      }
      const double mean = count > 0 ? sum / count : 0;
      const double spread = count > 1 ? std::sqrt(std::max(0.0, squares / count - mean * mean)) : 0;
      const std::size_t at = y * kMapWidth + x;
      spheres.difference[at] = static_cast<std::uint8_t>(std::min(255.0, kDifferenceStretch * spread));
      spheres.seers[at] = static_cast<std::uint8_t>(count);
    }
  });
  const int most = std::max(1, static_cast<int>(std::ranges::max(spheres.seers)));
  for (std::uint8_t& seers : spheres.seers) seers = static_cast<std::uint8_t>(255 * seers / most);
  return spheres;
}

/// The mean of the heads in colour, as a JPEG.
Result<std::vector<std::uint8_t>> colour_sphere(const PicturedHeads& rig) {
  std::vector<std::uint8_t> rgb(std::size_t{3} * kColourWidth * kColourHeight);
  for_rows(kColourWidth, kColourHeight, [&](std::size_t y, const auto& ray_at) {
    for (std::size_t x = 0; x < kColourWidth; ++x) {
      const Ray ray = ray_at(x);
      std::array<double, 3> sum{};
      double count = 0;
      for (std::size_t h = 0; h < rig.heads().size(); ++h) {
        const auto light = rig.colours(h, ray);
        if (!light) continue;
        for (std::size_t c = 0; c < 3; ++c) sum[c] += (*light)[c];
        ++count;
      }
      std::uint8_t* const pixel = &rgb[3 * (y * kColourWidth + x)];
      for (std::size_t c = 0; c < 3; ++c) pixel[c] = rig.shown(count > 0 ? sum[c] / count : 0);
    }
  });
  std::vector<std::uint8_t> jpeg;
  const ImageView view = packed_image(PixelFormat::kRgb24, kColourWidth, kColourHeight, std::as_const(rgb).data());
  const Status written = media::JpegWriter({PixelFormat::kRgb24, kColourWidth, kColourHeight}).write(view, "", jpeg);
  return written ? Result<std::vector<std::uint8_t>>(std::move(jpeg)) : fail(written.error());
}

std::vector<std::uint8_t> png(const std::vector<std::uint8_t>& values, int width, int height) {
  return media::png_file({width, height, 1, 8, values}, {SampleMeaning::srgb(), 0, "nodal register", {}, 6})
      .value_or(std::vector<std::uint8_t>());
}

// The centre of the area that two heads share, as a ray of the rig.
std::optional<Ray> middle_of(const PicturedHeads& rig, std::size_t a, std::size_t b) {
  double x = 0, y = 0, z = 0;
  for (int j = 0; j < kMapHeight; j += 6) {
    for (int i = 0; i < kMapWidth; i += 6) {
      const Ray ray = Ray::at(
          {((i + 0.5) / kMapWidth - 0.5) * 2 * std::numbers::pi, ((j + 0.5) / kMapHeight - 0.5) * std::numbers::pi});
      if (!rig.light(a, ray) || !rig.light(b, ray)) continue;
      const double weight = std::sin((j + 0.5) / kMapHeight * std::numbers::pi);
      x += weight * ray.x();
      y += weight * ray.y();
      z += weight * ray.z();
    }
  }
  if (std::hypot(x, y, z) < 1e-9) return std::nullopt;
  return Ray::towards(x, y, z);
}

// A plane view along `axis` in which squares of the two heads alternate: an edge that does not continue is an error.
std::vector<std::uint8_t> close_up(const PicturedHeads& rig, std::size_t a, std::size_t b, const Ray& axis) {
  const double pixel = 1 / (rig.heads()[a].lens().slope(0.1));
  // Two directions perpendicular to the axis.
  const bool steep = std::abs(axis.y()) > 0.9;
  const Ray up = steep ? Ray::towards(0, 0, 1) : Ray::towards(0, 1, 0);
  const Ray right = Ray::towards(up.y() * axis.z() - up.z() * axis.y(), up.z() * axis.x() - up.x() * axis.z(),
                                 up.x() * axis.y() - up.y() * axis.x());
  const Ray down =
      Ray::towards(axis.y() * right.z() - axis.z() * right.y(), axis.z() * right.x() - axis.x() * right.z(),
                   axis.x() * right.y() - axis.y() * right.x());
  std::vector<std::uint8_t> values(std::size_t{kClose} * kClose);
  parallel::Workers(0).run(kClose, [&](int j) {
    for (int i = 0; i < kClose; ++i) {
      const double u = (i + 0.5 - kClose / 2.0) * pixel, v = (j + 0.5 - kClose / 2.0) * pixel;
      const Ray ray = Ray::towards(axis.x() + u * right.x() + v * down.x(), axis.y() + u * right.y() + v * down.y(),
                                   axis.z() + u * right.z() + v * down.z());
      const bool first = (i / kChecker + j / kChecker) % 2 == 0;
      std::optional<double> light = rig.light(first ? a : b, ray);
      if (!light) light = rig.light(first ? b : a, ray);
      values[static_cast<std::size_t>(j * kClose + i)] = light ? rig.shown(*light) : std::uint8_t{0};
    }
  });
  return values;
}

void add_heads(const Report& report, HtmlReport& page) {
  std::vector<std::vector<std::string>> rows;
  for (const registration::HeadReport& head : report.heads) {
    rows.push_back({head.name, head.placed ? "placed" : "not changed", fmt::format("{:.4f}", head.turned_deg),
                    show_deviation(head.sigma_deg, "°"), fmt::format("{:.4f}", head.focal_change_percent),
                    show_deviation(head.sigma_focal_percent, " %"), fmt::format("{:.3f}", head.shared_sr),
                    head.why_not});
  }
  page.heading("Heads");
  page.paragraph(
      "How far each head was turned, and by how much its focal length was changed. ± is one standard deviation; "
      "\"fixed\" means that this number was not estimated.");
  page.table({"head", "", "turned, °", "±", "focal length, %", "±", "overlap, sr", ""}, rows);
}

void add_convergence(const Report& report, HtmlReport& page) {
  std::vector<ChartSeries> series;
  double step = 0;
  for (const registration::Step& each : report.steps) {
    const std::string name = fmt::format("{} wide", each.width);
    if (each.iteration == 0 || series.empty()) series.push_back({name, {}});
    series.back().points.emplace_back(step++, each.objective);
  }
  page.heading("How the differences became smaller");
  page.paragraph(
      "The mean square of the differences between heads where they overlap, step by step. It is first computed on a "
      "small picture of the sphere, then on larger ones: each shows more detail, so its curve starts higher again.");
  page.chart("Mean squared difference", "step", "(levels of 255)²", series, true);
}

void add_seams(const PicturedHeads& before, const PicturedHeads& after, const Report& report, HtmlReport& page) {
  std::vector<registration::PairReport> pairs = report.pairs;
  std::ranges::stable_sort(pairs, std::greater<>(), &registration::PairReport::shared_sr);
  page.heading("Seams, before and after");
  page.paragraph(
      "A chequerboard of two heads: one square shows the first head's picture, the next square the second one's, both "
      "at the same brightness. Where the directions are right, lines continue from square to square.");
  for (std::size_t k = 0; k < std::min(kSeams, pairs.size()); ++k) {
    const auto a = static_cast<std::size_t>(pairs[k].a), b = static_cast<std::size_t>(pairs[k].b);
    const std::optional<Ray> old_axis = middle_of(before, a, b), axis = middle_of(after, a, b);
    if (!old_axis || !axis) continue;
    const std::string names = report.heads[a].name + " and " + report.heads[b].name;
    page.pictures({{png(close_up(before, a, b, *old_axis), kClose, kClose), names + ", before"},
                   {png(close_up(after, a, b, *axis), kClose, kClose), names + ", after"}});
  }
}

// The head's direction as yaw and pitch.
GraphNode node_of(const Head& head, const registration::HeadReport& report) {
  const std::array<double, 9>& R = head.calibration().R_head_rig;  // its last row is the axis in the rig's frame
  return {report.name, kDegreesPerRadian * std::atan2(R[6], R[8]),
          -kDegreesPerRadian * std::asin(std::clamp(R[7], -1.0, 1.0)), !report.placed};
}

void add_graph(const PicturedHeads& rig, const Report& report, HtmlReport& page) {
  std::vector<GraphNode> nodes;
  for (std::size_t h = 0; h < report.heads.size(); ++h) nodes.push_back(node_of(rig.heads()[h], report.heads[h]));
  double most = 0;
  for (const registration::PairReport& pair : report.pairs) most = std::max(most, pair.shared_sr);
  std::vector<GraphLink> links;
  for (const registration::PairReport& pair : report.pairs) {
    const auto a = static_cast<std::size_t>(pair.a), b = static_cast<std::size_t>(pair.b);
    links.push_back({a, b, most > 0 ? pair.shared_sr / most : 0, pair.agreement,
                     fmt::format("{} and {}: {:.3f} sr, {:.2f} levels, agreement {:.2f}", report.heads[a].name,
                                 report.heads[b].name, pair.shared_sr, pair.rms_after, pair.agreement)});
  }
  page.heading("Overlaps of the heads");
  page.paragraph(
      "Each circle is a head, at the direction that it looks in, on a map of the sphere. A line joins two heads that "
      "overlap. If all lines of a head are thin (small overlaps) or red with short dashes (the pictures do not agree), "
      "its direction may be wrong.");
  page.drawing(sphere_graph(nodes, links));
}

/// Which heads are not placed, and which do not agree; empty if there are none.
std::string doubts_of(const Report& report) {
  const auto placed = std::ranges::count_if(report.heads, &registration::HeadReport::placed);
  const auto heads = static_cast<std::ptrdiff_t>(report.heads.size());
  const std::string poor = poor_pairs(report);
  if (placed == heads) return poor;
  return fmt::format("{} of {} heads are placed{}{}", placed, heads, poor.empty() ? "" : "; ", poor);
}

std::string name_of(const Report& report, int head) { return report.heads[static_cast<std::size_t>(head)].name; }

void add_pairs(const Report& report, HtmlReport& page) {
  std::vector<std::vector<std::string>> rows;
  for (const registration::PairReport& pair : report.pairs) {
    rows.push_back({name_of(report, pair.a), name_of(report, pair.b), fmt::format("{:.3f}", pair.shared_sr),
                    fmt::format("{:.2f}", pair.rms_before), fmt::format("{:.2f}", pair.rms_after),
                    fmt::format("{:.3f}", pair.agreement)});
  }
  page.heading("Pairs of heads");
  page.paragraph(
      "Differences are in levels of 255 (rms). Agreement is the correlation of the fine detail that both heads show: 1 "
      "is "
      "perfect.");
  page.table({"head", "and", "overlap, sr", "difference before", "after", "agreement"}, rows);
}

}  // namespace

std::string poor_pairs(const Report& report) {
  std::string names;
  for (const registration::PairReport& pair : report.pairs) {
    const bool placed =
        report.heads[static_cast<std::size_t>(pair.a)].placed && report.heads[static_cast<std::size_t>(pair.b)].placed;
    if (!placed || pair.agreement >= kPoorAgreement) continue;
    names += fmt::format("{}'{}' and '{}' ({:.2f})", names.empty() ? "" : ", ", name_of(report, pair.a),
                         name_of(report, pair.b), pair.agreement);
  }
  if (names.empty()) return "";
  return fmt::format(
      "these heads show different things where they overlap (in brackets their agreement: 1 is perfect, less than {} "
      "is poor): {}",
      kPoorAgreement, names);
}

Result<HtmlReport> registration_report(const Calibration& prior, const FrameSet& frames, const Report& report,
                                       std::string_view verdict) {
  const Result<PicturedHeads> before = PicturedHeads::make(prior, frames),
                              after = PicturedHeads::make(report.calibration, frames);
  if (!before) return fail(before.error());
  if (!after) return fail(after.error());
  HtmlReport page(
      "Registration: " + prior.name,
      fmt::format("{} heads. Where they overlap they differ by {:.2f} levels of 255 (rms); before, by {:.2f}",
                  prior.heads.size(), std::sqrt(report.objective_after), std::sqrt(report.objective_before)));
  if (!verdict.empty()) page.paragraph(verdict);
  if (const std::string doubts = doubts_of(report); !doubts.empty()) page.warning(doubts);
  for (const std::string& warning : report.warnings) page.warning(warning);
  const Spheres old_spheres = spheres_of(*before), spheres = spheres_of(*after);
  page.heading("The sphere");
  for (const auto& [rig, when] : {std::pair(&*after, "after"), std::pair(&*before, "before")}) {
    NODAL_TRY_ASSIGN(std::vector<std::uint8_t> sphere, colour_sphere(*rig));
    page.pictures({{std::move(sphere), std::string("mean of the heads, ") + when}});
  }
  add_heads(report, page);
  add_convergence(report, page);
  page.heading("Differences of the heads");
  page.pictures({{png(old_spheres.difference, kMapWidth, kMapHeight), "before; white is 32 levels or more"},
                 {png(spheres.difference, kMapWidth, kMapHeight), "after"}});
  page.pictures({{png(spheres.seers, kMapWidth, kMapHeight), "how many heads see each ray; black is none"}});
  add_graph(*after, report, page);
  add_pairs(report, page);
  add_seams(*before, *after, report, page);
  return page;
}

}  // namespace nodal::host
