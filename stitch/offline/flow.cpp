#include "stitch/offline/flow.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "stitch/offline/field.h"
#include "stitch/offline/flow_limit.h"

namespace nodal::offline {
namespace {

constexpr float kSmooth = 60;        ///< the cost of the flow's change, relative to that of gradients
constexpr float kMinChange = 0.05F;  ///< changes of the flow below this cost little, px
constexpr float kMinOff = 1;         ///< differences of gradients below this are noise, levels
constexpr float kRelaxation = 1.8F;
constexpr int kWarps = 4;          ///< warps per level
constexpr int kReweightings = 2;   ///< reweightings per warp
constexpr int kSweeps = 20;        ///< sweeps per reweighting
constexpr int kMinSide = 10;       ///< shortest side of the coarsest level, px
constexpr float kLongestStep = 1;  ///< longest step of a warp, px: gradients say nothing about what is farther away
/// Flow up to the first length is noise and becomes 0, from the second on it stays as it is, px: pictures without
/// parallax are best left as they are.
constexpr float kNoise = 0.15F, kSure = 0.45F;

Field derivative(const Field& in, bool down) {
  Field out(in.width, in.height);
  for (int y = 0; y < in.height; ++y) {
    const float* before = in.row(down ? std::max(0, y - 1) : y);
    const float* after = in.row(down ? std::min(in.height - 1, y + 1) : y);
    float* to = out.row(y);
    for (int x = 0; x < in.width; ++x) {
      to[x] = down ? (after[x] - before[x]) / 2
                   : (in.row(y)[std::min(in.width - 1, x + 1)] - in.row(y)[std::max(0, x - 1)]) / 2;
    }
  }
  return out;
}

/// `of_three` of each pixel and its neighbours, across and then down.
template <class OfThree>
Field in_both_directions(const Field& in, const OfThree& of_three) {
  Field across(in.width, in.height), out(in.width, in.height);
  for (int y = 0; y < in.height; ++y) {
    const float* row = in.row(y);
    for (int x = 0; x < in.width; ++x) {
      across.row(y)[x] = of_three(row[std::max(0, x - 1)], row[x], row[std::min(in.width - 1, x + 1)]);
    }
  }
  for (int y = 0; y < in.height; ++y) {
    const float* above = across.row(std::max(0, y - 1));
    const float* below = across.row(std::min(in.height - 1, y + 1));
    for (int x = 0; x < in.width; ++x) out.row(y)[x] = of_three(above[x], across.row(y)[x], below[x]);
  }
  return out;
}

/// (1 2 1) / 4 in both directions.
Field blurred(const Field& in) {
  return in_both_directions(in, [](float a, float b, float c) { return (a + 2 * b + c) / 4; });
}

/// The least of the 3 x 3 pixels around each one.
Field eroded(const Field& in) {
  return in_both_directions(in, [](float a, float b, float c) { return std::min({a, b, c}); });
}

Field half(const Field& in) {
  Field out((in.width + 1) / 2, (in.height + 1) / 2);
  for (int y = 0; y < out.height; ++y) {
    const float* a = in.row(2 * y);
    const float* b = in.row(std::min(2 * y + 1, in.height - 1));
    for (int x = 0; x < out.width; ++x) {
      const int right = std::min(2 * x + 1, in.width - 1);
      out.row(y)[x] = (a[2 * x] + a[right] + b[2 * x] + b[right]) / 4;
    }
  }
  return out;
}

/// One picture at one level.
struct Level {
  Field levels, seen;
  Field known;                                    ///< 1 where the pixels around are seen, too
  std::array<Field, 2> gradient;                  ///< across, down
  std::array<std::array<Field, 2>, 2> curvature;  ///< derivatives of each gradient: across, down

  void derive() {
    known = eroded(eroded(seen));
    const Field smooth = blurred(levels);
    for (std::size_t c = 0; c < 2; ++c) {
      gradient[c] = derivative(smooth, c == 1);
      for (std::size_t d = 0; d < 2; ++d) curvature[c][d] = derivative(gradient[c], d == 1);
    }
  }
};

std::vector<Level> pyramid(const SeenPicture& picture) {
  std::vector<Level> levels(1);
  levels[0].levels = Field(picture.width, picture.height);
  levels[0].levels.v = picture.levels;
  levels[0].seen = Field(picture.width, picture.height);
  levels[0].seen.v = picture.seen;
  while (std::min(levels.back().levels.width, levels.back().levels.height) >= 2 * kMinSide) {
    const Level& fine = levels.back();
    Level coarse;
    Field weighted = fine.levels;
    for (std::size_t k = 0; k < weighted.v.size(); ++k) weighted.v[k] *= fine.seen.v[k];
    coarse.levels = half(weighted);
    coarse.seen = half(fine.seen);
    for (std::size_t k = 0; k < coarse.seen.v.size(); ++k) {
      float& seen = coarse.seen.v[k];
      if (seen > 0) coarse.levels.v[k] /= seen;
      seen = seen > 0.99F ? 1 : 0;
    }
    levels.push_back(std::move(coarse));
  }
  // Unseen pixels get the coarser level's, so that derivatives at the edge of what is seen are small.
  for (std::size_t l = levels.size() - 1; l-- > 0;) {
    Field& fine = levels[l].levels;
    const Field& coarse = levels[l + 1].levels;
    for (int y = 0; y < fine.height; ++y) {
      for (int x = 0; x < fine.width; ++x) {
        if (levels[l].seen.row(y)[x] < 1) fine.row(y)[x] = coarse.row(y / 2)[x / 2];
      }
    }
  }
  for (Level& level : levels) level.derive();
  return levels;
}

/// The linear equations of one warp: for each pixel A d = r + the neighbours' share.
struct Equations {
  Field a11, a12, a22, b1, b2;
  std::array<Field, 2> ix, iy, off;
  Field known;

  Equations(int w, int h) : a11(w, h), a12(w, h), a22(w, h), b1(w, h), b2(w, h), known(w, h) {
    for (std::size_t c = 0; c < 2; ++c) ix[c] = iy[c] = off[c] = Field(w, h);
  }
};

void warp(const Level& a, const Level& b, const Field& share, const Field& fx, const Field& fy, Equations& to) {
  const int width = share.width, height = share.height;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t k = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      const float of_a = share.v[k], of_b = 1 - of_a;
      const Place p =
          place_of(width, height, static_cast<float>(x) - of_b * fx.v[k], static_cast<float>(y) - of_b * fy.v[k]);
      const Place q =
          place_of(width, height, static_cast<float>(x) + of_a * fx.v[k], static_cast<float>(y) + of_a * fy.v[k]);
      to.known.v[k] = sample(a.known, p) > 0.999F && sample(b.known, q) > 0.999F ? 1 : 0;
      for (std::size_t c = 0; c < 2; ++c) {
        to.off[c].v[k] = sample(b.gradient[c], q) - sample(a.gradient[c], p);
        to.ix[c].v[k] = of_a * sample(b.curvature[c][0], q) + of_b * sample(a.curvature[c][0], p);
        to.iy[c].v[k] = of_a * sample(b.curvature[c][1], q) + of_b * sample(a.curvature[c][1], p);
      }
    }
  }
}

/// Weights of the robust norms, at flow f + d.
void reweight(Equations& e, const Field& fx, const Field& fy, const Field& dx, const Field& dy, Field& smooth) {
  const int width = fx.width, height = fx.height;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t k = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      float off2 = kMinOff * kMinOff;
      for (std::size_t c = 0; c < 2; ++c) {
        const float off = e.off[c].v[k] + e.ix[c].v[k] * dx.v[k] + e.iy[c].v[k] * dy.v[k];
        off2 += off * off;
      }
      const float weight = e.known.v[k] / std::sqrt(off2);
      float a11 = 0, a12 = 0, a22 = 0, b1 = 0, b2 = 0;
      for (std::size_t c = 0; c < 2; ++c) {
        a11 += e.ix[c].v[k] * e.ix[c].v[k];
        a12 += e.ix[c].v[k] * e.iy[c].v[k];
        a22 += e.iy[c].v[k] * e.iy[c].v[k];
        b1 -= e.ix[c].v[k] * e.off[c].v[k];
        b2 -= e.iy[c].v[k] * e.off[c].v[k];
      }
      e.a11.v[k] = weight * a11;
      e.a12.v[k] = weight * a12;
      e.a22.v[k] = weight * a22;
      e.b1.v[k] = weight * b1;
      e.b2.v[k] = weight * b2;
      const std::size_t right = x + 1 < width ? k + 1 : k;
      const std::size_t below = y + 1 < height ? k + static_cast<std::size_t>(width) : k;
      float change2 = kMinChange * kMinChange;
      for (const std::size_t n : {right, below}) {
        const float u = fx.v[n] + dx.v[n] - fx.v[k] - dx.v[k], v = fy.v[n] + dy.v[n] - fy.v[k] - dy.v[k];
        change2 += u * u + v * v;
      }
      smooth.v[k] = kSmooth * kMinChange / std::sqrt(change2);
    }
  }
}

void relax(const Equations& e, const Field& smooth, const Field& fx, const Field& fy, Field& dx, Field& dy) {
  const int width = fx.width, height = fx.height;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const std::size_t k =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
        float sum = 1e-6F, u = 0, v = 0;
        const auto add = [&](std::size_t n, float weight) {
          sum += weight;
          u += weight * (fx.v[n] + dx.v[n]);
          v += weight * (fy.v[n] + dy.v[n]);
        };
        if (x > 0) add(k - 1, (smooth.v[k] + smooth.v[k - 1]) / 2);
        if (x + 1 < width) add(k + 1, (smooth.v[k] + smooth.v[k + 1]) / 2);
        const auto row = static_cast<std::size_t>(width);
        if (y > 0) add(k - row, (smooth.v[k] + smooth.v[k - row]) / 2);
        if (y + 1 < height) add(k + row, (smooth.v[k] + smooth.v[k + row]) / 2);
        const float r1 = e.b1.v[k] + u - sum * fx.v[k], r2 = e.b2.v[k] + v - sum * fy.v[k];
        const float a11 = e.a11.v[k] + sum, a22 = e.a22.v[k] + sum, a12 = e.a12.v[k];
        const float det = a11 * a22 - a12 * a12;
        dx.v[k] += kRelaxation * ((a22 * r1 - a12 * r2) / det - dx.v[k]);
        dy.v[k] += kRelaxation * ((a11 * r2 - a12 * r1) / det - dy.v[k]);
      }
    }
  }
}

/// The median of the 3 x 3 pixels around each one: takes away outliers.
Field medians(const Field& in) {
  Field out(in.width, in.height);
  for (int y = 0; y < in.height; ++y) {
    for (int x = 0; x < in.width; ++x) {
      std::array<float, 9> around;
      for (int k = 0; k < 9; ++k) {
        around[static_cast<std::size_t>(k)] =
            in.row(std::clamp(y + k / 3 - 1, 0, in.height - 1))[std::clamp(x + k % 3 - 1, 0, in.width - 1)];
      }
      std::nth_element(around.begin(), around.begin() + 4, around.end());
      out.row(y)[x] = around[4];
    }
  }
  return out;
}

Field doubled(const Field& coarse, int width, int height) {
  Field fine(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      fine.row(y)[x] = 2 * sample(coarse, place_of(coarse.width, coarse.height, (static_cast<float>(x) - 0.5F) / 2,
                                                   (static_cast<float>(y) - 0.5F) / 2));
    }
  }
  return fine;
}

}  // namespace

void Flow::at(double u, double v, double& dx, double& dy) const {
  const Place p = place_of(width, height, static_cast<float>(u - 0.5), static_cast<float>(v - 0.5));
  dx = sample(x, p);
  dy = sample(y, p);
}

Flow flow_between(const SeenPicture& a, const SeenPicture& b, const std::vector<float>& share) {
  const std::vector<Level> as = pyramid(a), bs = pyramid(b);
  std::vector<Field> shares(1, Field(a.width, a.height));
  shares[0].v = share;
  while (shares.size() < as.size()) shares.push_back(half(shares.back()));
  Field fx, fy;
  for (std::size_t l = as.size(); l-- > 0;) {
    const int width = shares[l].width, height = shares[l].height;
    fx = fx.v.empty() ? Field(width, height) : doubled(fx, width, height);
    fy = fy.v.empty() ? Field(width, height) : doubled(fy, width, height);
    Equations equations(width, height);
    Field smooth(width, height);
    for (int k = 0; k < kWarps; ++k) {
      warp(as[l], bs[l], shares[l], fx, fy, equations);
      Field dx(width, height), dy(width, height);
      for (int r = 0; r < kReweightings; ++r) {
        reweight(equations, fx, fy, dx, dy, smooth);
        relax(equations, smooth, fx, fy, dx, dy);
      }
      for (std::size_t p = 0; p < fx.v.size(); ++p) {
        fx.v[p] += std::clamp(dx.v[p], -kLongestStep, kLongestStep);
        fy.v[p] += std::clamp(dy.v[p], -kLongestStep, kLongestStep);
      }
      fx = medians(fx);
      fy = medians(fy);
    }
  }
  limit_flow(as[0].known, bs[0].known, shares[0], fx, fy);
  for (std::size_t p = 0; p < fx.v.size(); ++p) {
    const float length = std::hypot(fx.v[p], fy.v[p]);
    const float kept = std::clamp((length - kNoise) / (kSure - kNoise), 0.0F, 1.0F);
    fx.v[p] *= kept;
    fy.v[p] *= kept;
  }
  return {a.width, a.height, std::move(fx.v), std::move(fy.v)};
}

}  // namespace nodal::offline
