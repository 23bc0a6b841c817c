// calib_results.txt of Scaramuzza's OCamCalib toolbox: one camera, no orientation. Scaramuzza, Martinelli, Siegwart, "A
// toolbox for easily calibrating omnidirectional cameras", IROS 2006.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/interchange/camera_files.h"
#include "stitch/interchange/foreign_head.h"
#include "stitch/interchange/known_fields.h"
#include "stitch/interchange/panotools_head.h"

namespace nodal::interchange {
namespace {

constexpr std::size_t kMaxCoefficients = 32;

/// The file's lines of numbers, with the numbers of the lines.
struct Row {
  int line = 0;
  std::vector<double> numbers;
};

Result<std::vector<Row>> read_rows(std::string_view text) {
  std::vector<Row> rows;
  for (int line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view rest = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    Row row{line, {}};
    while (true) {
      rest.remove_prefix(std::min(rest.find_first_not_of(" \t\r"), rest.size()));
      if (rest.empty() || rest.front() == '#') break;
      const std::string_view word = rest.substr(0, rest.find_first_of(" \t\r"));
      double number = 0;
      const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), number);
      if (error != std::errc() || stop != word.data() + word.size() || !std::isfinite(number)) {
        return fail(Errc::kBadFormat, fmt::format("line {}: '{}' is no number", line, word.substr(0, 32)));
      }
      if (row.numbers.size() > kMaxCoefficients) {
        return fail(Errc::kTooLarge, fmt::format("line {}: too many numbers", line));
      }
      row.numbers.push_back(number);
      rest.remove_prefix(word.size());
    }
    if (!row.numbers.empty()) rows.push_back(std::move(row));
  }
  return rows;
}

/// From a point of the sensor's plane to the picture: row = c x + d y + row0, column = e x + y + column0; x down, y
/// right, px with a pixel's centre at integers. The ray is (x, y, f(r)), r = |(x, y)|; the axis points backwards.
struct OcamModel {
  std::vector<double> f;  ///< coefficients of 1, r, r^2, ...
  double row0 = 0, column0 = 0, c = 1, d = 0, e = 0;
  int width = 0, height = 0;

  double depth(double r) const {
    double value = 0;
    for (auto k = f.rbegin(); k != f.rend(); ++k) value = value * r + *k;
    return -value;
  }
  double angle(double r) const { return std::atan2(r, depth(r)); }
};

Result<OcamModel> read_model(const std::vector<Row>& rows) {
  if (rows.size() < 5) {
    return fail(Errc::kMissingField, fmt::format("an OCamCalib file has five lines of numbers (the polynomial, its "
                                                 "inverse, the centre, c d e, and height and width), and this one {}",
                                                 rows.size()));
  }
  const auto wrong = [](const Row& row, const std::string& what) {
    return fail(Errc::kBadValue, fmt::format("line {}: {}", row.line, what));
  };
  const Row &polynomial = rows[0], &centre = rows[2], &affine = rows[3], &size = rows[4];
  OcamModel model;
  model.f.assign(polynomial.numbers.begin() + 1, polynomial.numbers.end());
  if (model.f.size() < 2 || static_cast<double>(model.f.size()) != polynomial.numbers.front()) {
    return wrong(polynomial, "the number of coefficients, then as many coefficients, two at least");
  }
  if (!(model.f[0] < 0))
    return wrong(polynomial, "the first coefficient must be negative: OCam's axis points backwards");
  if (centre.numbers.size() != 2) return wrong(centre, "the centre is a row and a column");
  if (affine.numbers.size() != 3) return wrong(affine, "there must be three numbers, c, d and e");
  if (size.numbers.size() != 2) return wrong(size, "the picture's size is a height and a width");
  model.row0 = centre.numbers[0], model.column0 = centre.numbers[1];
  model.c = affine.numbers[0], model.d = affine.numbers[1], model.e = affine.numbers[2];
  const bool small = std::abs(model.d) < 0.5 && std::abs(model.e) < 0.5;
  if (!(small && model.c > 0.5 && model.c < 2)) return wrong(affine, "c must be about 1, d and e about 0");
  NODAL_TRY_ASSIGN(const int height, picture_side(size.numbers[0], "height"));
  NODAL_TRY_ASSIGN(const int width, picture_side(size.numbers[1], "width"));
  model.height = height, model.width = width;
  if (!(model.row0 > 0 && model.row0 < model.height && model.column0 > 0 && model.column0 < model.width)) {
    return wrong(centre, "the centre is not in the picture");
  }
  return model;
}

/// Up to where angles rise with the radius; at most `farthest`.
double end_of(const OcamModel& model, double farthest) {
  constexpr int kRadialSteps = 2000;
  constexpr double kWidest = kPi - 0.02;
  double before = 0;
  for (int i = 1; i <= kRadialSteps; ++i) {
    const double r = farthest * i / kRadialSteps, a = model.angle(r);
    if (!(a > before && a < kWidest)) return farthest * (i - 1) / kRadialSteps;
    before = a;
  }
  return farthest;
}

}  // namespace

Status add_ocam_camera(std::string_view text, std::string_view path, ImportResult& result) {
  NODAL_TRY_ASSIGN(const std::vector<Row> rows, read_rows(text));
  NODAL_TRY_ASSIGN(const OcamModel read, read_model(rows));
  const OcamModel& model = read;
  std::vector<std::string> taken;
  for (const HeadCalibration& other : result.calibration.heads) taken.push_back(other.name);
  HeadCalibration head = blank_head(head_name(path, taken), model.width, model.height);
  head.center_x = model.column0 + 0.5;
  head.center_y = model.row0 + 0.5;
  const double farthest = std::hypot(std::max(model.column0, model.width - model.column0),
                                     std::max(model.row0, model.height - model.row0) / model.c);
  const double end = end_of(model, farthest);
  if (!(end > 1)) {
    return fail(Errc::kBadValue,
                "head '" + head.name + "': by its polynomial, angles do not rise from the centre outwards");
  }
  std::vector<geometry::RayPixel> samples;
  constexpr int kRadii = 60, kTurns = 24;
  for (int i = 1; i <= kRadii; ++i) {
    for (int k = 0; k < kTurns; ++k) {
      const double r = end * i / kRadii, turn = 2 * kPi * k / kTurns;
      const double x = r * std::cos(turn), y = r * std::sin(turn);
      const geometry::Pixel pixel{model.e * x + y + head.center_x, model.c * x + model.d * y + head.center_y};
      if (pixel.x < 0 || pixel.y < 0 || pixel.x > model.width || pixel.y > model.height) continue;
      samples.push_back({Eigen::Vector3d(y, x, model.depth(r)).normalized(), pixel});
    }
  }
  PolynomialHead start;
  start.exponents = {1, 2, 3, 4, 5, 6, 7};
  start.cx = head.center_x;
  start.cy = head.center_y;
  start.aspect = model.c;
  const Result<PolynomialHead> fit = fit_polynomial_head(samples, start, {true, true, true});
  if (!fit) return fail(fit.error().in("head '" + head.name + "'"));
  take_fit(*fit, "its polynomial of depth by radius, and the shear of its pixels, have no exact counterpart", head,
           result.notes);
  if (end < farthest) {
    head.region.circle = {head.center_x, head.center_y, end * std::min(1.0, model.c)};
    result.notes.push_back(fmt::format("The lens of head '{}' ends {} px from its centre: only that circle is used.",
                                       head.name, static_cast<int>(end)));
  }
  NODAL_TRY(finish_head(head, result.notes));
  FieldCheck check(ocam_fields());
  for (std::size_t row = 0; row < rows.size(); ++row) {
    check.see("line of numbers", std::to_string(row + 1), "", "head '" + head.name + "'");
  }
  NODAL_TRY(check.tell(result.notes));
  result.calibration.heads.push_back(std::move(head));
  result.images.emplace_back();
  return {};
}

}  // namespace nodal::interchange
