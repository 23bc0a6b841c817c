#include "tests/support/photographer.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace nodal::photographer {
namespace {

constexpr int kSub = 5;  // sampling points across a pixel
constexpr double kDegree = std::numbers::pi / 180;
using Matrix = std::array<std::array<double, 3>, 3>;

Matrix turn(int axis, double angle) {
  Matrix R{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  const auto a = static_cast<std::size_t>((axis + 1) % 3);
  const auto b = static_cast<std::size_t>((axis + 2) % 3);
  R[a][a] = R[b][b] = std::cos(angle);
  R[a][b] = -std::sin(angle);
  R[b][a] = std::sin(angle);
  return R;
}

Matrix times(const Matrix& A, const Matrix& B) {
  Matrix C{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) C[i][j] += A[i][k] * B[k][j];
  return C;
}

/// Weights of the sampling points from `first` on, counted from a pixel's first: a Gaussian convolved with the pixel.
struct Footprint {
  int first = 0;
  std::vector<double> taps;
};

Footprint footprint(double sigma) {
  const int reach = static_cast<int>(std::ceil(4 * sigma));
  Footprint pixel{-reach, std::vector<double>(static_cast<std::size_t>(2 * reach + kSub))};
  double sum = 0;
  for (int k = -reach; k <= reach; ++k) {
    const double weight = k == 0 ? 1 : std::exp(-0.5 * k * k / (sigma * sigma));
    for (int a = 0; a < kSub; ++a) pixel.taps[static_cast<std::size_t>(k + reach + a)] += weight;
    sum += weight * kSub;
  }
  for (double& tap : pixel.taps) tap /= sum;
  return pixel;
}

/// Filters the light at the sampling points to pixels, row by row; beyond the edge the edge is repeated.
std::vector<double> through_pixels(const std::vector<float>& fine, int width, int height, const Footprint& pixel) {
  const int fine_width = width * kSub, taps = static_cast<int>(pixel.taps.size());
  std::vector<double> line(static_cast<std::size_t>(fine_width)), light;
  light.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int j = 0; j < height; ++j) {
    std::ranges::fill(line, 0.0);
    for (int k = 0; k < taps; ++k) {
      const int from = std::clamp(j * kSub + pixel.first + k, 0, height * kSub - 1);
      const float* row = fine.data() + static_cast<std::size_t>(from) * line.size();
      const double tap = pixel.taps[static_cast<std::size_t>(k)];
      for (std::size_t i = 0; i < line.size(); ++i) line[i] += tap * static_cast<double>(row[i]);
    }
    for (int i = 0; i < width; ++i) {
      double sum = 0;
      for (int k = 0; k < taps; ++k) {
        const int from = std::clamp(i * kSub + pixel.first + k, 0, fine_width - 1);
        sum += pixel.taps[static_cast<std::size_t>(k)] * line[static_cast<std::size_t>(from)];
      }
      light.push_back(sum);
    }
  }
  return light;
}

/// A fisheye's angle from the axis for a radius: Newton's method, with bisection where a step would leave the bracket;
/// negative if there is none.
double fisheye_angle(const Lens& lens, double r) {
  const auto& k = lens.k;
  double low = 0, high = 2.2;
  double a = std::min(r / lens.f, high);
  const auto radius = [&](double b) {
    const double s = b * b;
    return lens.f * b * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
  };
  if (radius(high) < r) return -1;
  for (int n = 0; n < 60; ++n) {
    const double s = a * a, off = radius(a) - r;
    (off < 0 ? low : high) = a;
    const double next = a - off / (lens.f * (1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3])))));
    if (std::abs(next - a) < 1e-9) return next;  // the remaining error is about its square
    a = next > low && next < high ? next : (low + high) / 2;
  }
  return a;
}

}  // namespace

std::array<double, 3> Lens::ray(double u, double v) const {
  const double x = u - cx;
  const double y = (v - cy) / aspect;
  const double s = x * x + y * y;
  if (kind == Kind::kTsai) {
    const double stretch = 1 + s * (k[0] + s * k[1]);
    if (stretch < 0) return {0, 0, 0};
    const double length = std::sqrt(stretch * stretch * s + f * f);
    return {stretch * x / length, stretch * y / length, f / length};
  }
  const double r = std::sqrt(s);
  if (r < 1e-9) return {0, 0, 1};
  const double a = fisheye_angle(*this, r);
  if (a < 0) return {0, 0, 0};
  const double across = std::sin(a) / r;
  return {across * x, across * y, std::cos(a)};
}

Photo take(const Scene& scene, const Lens& lens, const Shot& shot) {
  const int width = lens.width * kSub;
  const int height = lens.height * kSub;
  const Matrix lean = times(turn(2, shot.tilt_about_deg * kDegree),
                            times(turn(0, shot.tilt_deg * kDegree), turn(2, -shot.tilt_about_deg * kDegree)));
  const Matrix R = times(lean, turn(2, shot.spin_deg * kDegree));  // scene to head
  const double half_diagonal = std::hypot(lens.width, lens.height) / 2;
  std::vector<float> fine(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int j = 0; j < height; ++j) {
    for (int i = 0; i < width; ++i) {
      const std::array<double, 3> d = lens.ray((i + 0.5) / kSub, (j + 0.5) / kSub);
      double light = 0;
      const double slant = d[0] * R[0][2] + d[1] * R[1][2] + d[2] * R[2][2];
      if (slant > 0) {
        // The plane contains (0, 0, distance) and has R's third column as its normal.
        const double along = shot.distance * R[2][2] / slant;
        const std::array<double, 3> p{along * d[0], along * d[1], along * d[2] - shot.distance};
        const double X = shot.x + p[0] * R[0][0] + p[1] * R[1][0] + p[2] * R[2][0];
        const double Y = shot.y + p[0] * R[0][1] + p[1] * R[1][1] + p[2] * R[2][1];
        const double reflectance = scene(X, Y);
        light = reflectance < 0 ? shot.background
                                : reflectance * (1 + shot.light_x * X + shot.light_y * Y + shot.light_xx * X * X);
      }
      fine[static_cast<std::size_t>(j) * static_cast<std::size_t>(width) + static_cast<std::size_t>(i)] =
          static_cast<float>(light);
    }
  }
  const std::vector<double> seen = through_pixels(fine, lens.width, lens.height, footprint(shot.blur_px * kSub));
  std::mt19937_64 engine(shot.seed);
  std::normal_distribution<double> noise(0, std::max(shot.noise, 1e-9));
  Photo photo{lens.width, lens.height, {}};
  for (int j = 0; j < lens.height; ++j) {
    for (int i = 0; i < lens.width; ++i) {
      const double r = std::hypot(i + 0.5 - lens.cx, (j + 0.5 - lens.cy) / lens.aspect) / half_diagonal;
      const double s = r * r;
      const auto& v = shot.vignetting;
      const double light = seen[photo.grey.size()] * shot.exposure * (1 + s * (v[0] + s * (v[1] + s * v[2])));
      const double encoded = 255 * std::pow(std::clamp(light, 0.0, 1.0), 1 / shot.gamma) + noise(engine);
      photo.grey.push_back(static_cast<std::uint8_t>(std::clamp(std::lround(encoded), 0L, 255L)));
    }
  }
  return photo;
}

Scene print_of(int width, int height, const std::vector<std::uint8_t>& grey) {
  std::array<double, 256> light{};
  for (std::size_t v = 0; v < 256; ++v) {
    const double e = static_cast<double>(v) / 255;
    light[v] = e <= 0.04045 ? e / 12.92 : std::pow((e + 0.055) / 1.055, 2.4);
  }
  return [=](double X, double Y) {
    const double i = X * width + width / 2.0;
    const double j = Y * width + height / 2.0;
    if (i < 0 || j < 0 || i >= width || j >= height) return -1.0;
    return light[grey[static_cast<std::size_t>(j) * static_cast<std::size_t>(width) + static_cast<std::size_t>(i)]];
  };
}

Scene chessboard(int columns, int rows) {
  return [=](double X, double Y) {
    const double square = 1.0 / (columns + 2);
    const double i = std::floor(X / square + columns / 2.0);
    const double j = std::floor(Y / square + rows / 2.0);
    if (i < -1 || j < -1 || i > columns || j > rows) return -1.0;
    if (i < 0 || j < 0 || i >= columns || j >= rows) return 0.85;
    return (static_cast<long>(i) + static_cast<long>(j)) % 2 == 0 ? 0.05 : 0.85;
  };
}

}  // namespace nodal::photographer
