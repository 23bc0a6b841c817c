#include "hal/sim/scene/scene.h"

#include <array>

namespace nodal::hal::sim {

namespace {

class ConstantScene final : public Scene {
 public:
  explicit ConstantScene(Light light) : light_(light) {}
  Light light(const Direction& /*from*/, double /*footprint_rad*/) const override { return light_; }

 private:
  const Light light_;
};

class BarScene final : public Scene {
 public:
  explicit BarScene(const Mover& bar) : movers_{bar} {}
  Light light(const Direction& /*from*/, double /*footprint_rad*/) const override { return {0.2F, 0.2F, 0.2F}; }
  std::span<const Mover> movers() const override { return movers_; }

 private:
  const std::array<Mover, 1> movers_;
};

}  // namespace

ScenePtr bar_scene(const Direction& axis, Duration period, double half_rad) {
  Mover bar;
  bar.shape = Mover::Shape::kBar;
  bar.axis = axis;
  bar.start = {0, 0, 1};
  bar.period = period;
  bar.radius_rad = half_rad;
  bar.colour = bar.stripes = {0.8F, 0.8F, 0.8F};
  return std::make_shared<BarScene>(bar);
}

ScenePtr constant_scene(Light light) { return std::make_shared<ConstantScene>(light); }

}  // namespace nodal::hal::sim
