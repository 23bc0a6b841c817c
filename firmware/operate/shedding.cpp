#include "firmware/operate/shedding.h"

#include <algorithm>

namespace nodal::firmware {

void Shedding::step(std::uint64_t sets, std::uint64_t not_taken, bool excused, Duration period, Instant now) {
  excused_ = excused_ || excused;
  if (window_ && now - *window_ < kWindow.at(period)) return;
  const std::uint64_t came = sets - sets_;
  const std::uint64_t lost = not_taken - not_taken_;
  const bool judged = window_ && !excused_;
  window_ = now;
  sets_ = sets;
  not_taken_ = not_taken;
  excused_ = excused;
  if (!judged) {
    overloaded_ = calm_ = 0;
    return;
  }
  overloaded_ = lost * 20 > came ? overloaded_ + 1 : 0;
  calm_ = lost == 0 ? calm_ + 1 : 0;
  if (overloaded_ == 2 && level_ + 1 < kShedLevels.size()) {
    ++level_;
    if (lowered_) patience_ = std::min(2 * patience_, kMaxPatience);
    lowered_ = false;
    overloaded_ = 0;
  } else if (calm_ >= patience_ && level_ > 0) {
    --level_;
    lowered_ = true;
    calm_ = 0;
  } else if (calm_ >= kMaxPatience) {
    patience_ = kPatience;
  }
}

}  // namespace nodal::firmware
