#include "tests/support/photographer.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace nodal::photographer {
namespace {

constexpr int kSub = 5;  // places across a pixel
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

void blur_rows(std::vector<float>& image, int width, int height, double sigma) {
  const int reach = static_cast<int>(std::ceil(4 * sigma));
  std::vector<double> taps;
  double sum = 0;
  for (int k = -reach; k <= reach; ++k) {
    taps.push_back(std::exp(-0.5 * k * k / (sigma * sigma)));
    sum += taps.back();
  }
  std::vector<float> line(static_cast<std::size_t>(width));
  for (int j = 0; j < height; ++j) {
    float* row = image.data() + static_cast<std::size_t>(j) * static_cast<std::size_t>(width);
    for (int i = 0; i < width; ++i) {
      double value = 0;
      for (int k = -reach; k <= reach; ++k) {
        value += taps[static_cast<std::size_t>(k + reach)] * static_cast<double>(row[std::clamp(i + k, 0, width - 1)]);
      }
      line[static_cast<std::size_t>(i)] = static_cast<float>(value / sum);
    }
    std::copy(line.begin(), line.end(), row);
  }
}

std::vector<float> transposed(const std::vector<float>& image, int width, int height) {
  std::vector<float> out(image.size());
  for (int j = 0; j < height; ++j) {
    for (int i = 0; i < width; ++i) {
      out[static_cast<std::size_t>(i) * static_cast<std::size_t>(height) + static_cast<std::size_t>(j)] =
          image[static_cast<std::size_t>(j) * static_cast<std::size_t>(width) + static_cast<std::size_t>(i)];
    }
  }
  return out;
}

}  // namespace

double Lens::angle(double r) const {
  if (kind == Kind::kTsai) return std::atan(r * (1 + r * r * (k[0] + r * r * k[1])) / f);
  const auto radius = [&](double a) {
    const double s = a * a;
    return f * a * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
  };
  double low = 0;
  double high = 2.2;
  if (radius(high) < r) return -1;
  for (int n = 0; n < 60; ++n) (radius((low + high) / 2) < r ? low : high) = (low + high) / 2;
  return (low + high) / 2;
}

std::array<double, 3> Lens::ray(double u, double v) const {
  const double x = u - cx;
  const double y = (v - cy) / aspect;
  const double r = std::hypot(x, y);
  if (r < 1e-9) return {0, 0, 1};
  const double a = angle(r);
  if (a < 0) return {0, 0, 0};
  return {std::sin(a) * x / r, std::sin(a) * y / r, std::cos(a)};
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
        // The plane goes through (0, 0, distance) with normal R's third column.
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
  if (shot.blur_px > 0) {
    blur_rows(fine, width, height, shot.blur_px * kSub);
    fine = transposed(fine, width, height);
    blur_rows(fine, height, width, shot.blur_px * kSub);
    fine = transposed(fine, height, width);
  }
  std::mt19937_64 engine(shot.seed);
  std::normal_distribution<double> noise(0, std::max(shot.noise, 1e-9));
  Photo photo{lens.width, lens.height, {}};
  for (int j = 0; j < lens.height; ++j) {
    for (int i = 0; i < lens.width; ++i) {
      double light = 0;
      for (int b = 0; b < kSub; ++b) {
        for (int a = 0; a < kSub; ++a) {
          light += static_cast<double>(fine[static_cast<std::size_t>(j * kSub + b) * static_cast<std::size_t>(width) +
                                            static_cast<std::size_t>(i * kSub + a)]);
        }
      }
      const double r = std::hypot(i + 0.5 - lens.cx, (j + 0.5 - lens.cy) / lens.aspect) / half_diagonal;
      const double s = r * r;
      const auto& v = shot.vignetting;
      light *= shot.exposure / (kSub * kSub) * (1 + s * (v[0] + s * (v[1] + s * v[2])));
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
    const double i = std::floor(X * width + width / 2.0);
    const double j = std::floor(Y * width + height / 2.0);
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
