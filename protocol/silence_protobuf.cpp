#include "protocol/silence_protobuf.h"

#include <google/protobuf/stubs/logging.h>

namespace nodal {

void silence_protobuf() {
  static const bool once = [] {
    google::protobuf::SetLogHandler(nullptr);
    return true;
  }();
  static_cast<void>(once);
}

}  // namespace nodal
