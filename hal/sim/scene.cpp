#include "hal/sim/scene.h"

namespace nodal::hal::sim {

namespace {

class ConstantScene final : public Scene {
 public:
  explicit ConstantScene(Light light) : light_(light) {}
  Light light(const Direction& /*from*/, double /*footprint_rad*/) const override { return light_; }

 private:
  const Light light_;
};

}  // namespace

ScenePtr constant_scene(Light light) { return std::make_shared<ConstantScene>(light); }

}  // namespace nodal::hal::sim
