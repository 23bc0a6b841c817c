#include "hal/sim/rig.h"

namespace nodal::hal::sim {

class SimRig::Enumerator final : public HeadEnumerator {
 public:
  explicit Enumerator(SimRig& rig) : rig_(rig) {}

  Result<std::unique_ptr<HeadPort>> open(const std::string& path) override {
    if (SimHead* head = rig_.find(path)) return head->open();
    std::string known;
    for (const auto& head : rig_.heads_) known += (known.empty() ? "" : ", ") + head->identity().path;
    return fail(Errc::kNoSuchDevice, "head '" + path + "': the simulated rig has no such head, only " + known);
  }

  std::vector<HeadIdentity> list() override {
    std::vector<HeadIdentity> present;
    for (const auto& head : rig_.heads_) {
      if (head->present()) present.push_back(head->identity());
    }
    return present;
  }

 private:
  SimRig& rig_;
};

SimRig::SimRig(const Calibration& truth, SimRigOptions options)
    : truth_(truth),
      clock_(options.real_time ? SimClock::Kind::kReal : SimClock::Kind::kVirtual),
      trigger_(clock_, options.trigger, options.seed),
      enumerator_(std::make_unique<Enumerator>(*this)) {
  NODAL_ASSERT(truth_.heads.size() <= static_cast<std::size_t>(kMaxHeads));
  if (!options.scene) options.scene = town_square_scene(options.seed);
  for (std::size_t i = 0; i < truth_.heads.size(); ++i) {
    HeadOptions head = options.head;
    const auto index = static_cast<HeadIndex>(i);
    if (options.adjust) options.adjust(index, head);
    heads_.push_back(std::make_unique<SimHead>(clock_, trigger_, options.scene, truth_.heads[i], head, options.seed));
    trigger_.connect(index, heads_.back().get());
  }
}

SimRig::~SimRig() = default;

HeadEnumerator& SimRig::enumerator() { return *enumerator_; }

SimHead* SimRig::find(const std::string& path) {
  for (const auto& head : heads_) {
    if (head->identity().path == path) return head.get();
  }
  return nullptr;
}

}  // namespace nodal::hal::sim
