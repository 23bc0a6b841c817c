// Envelopes: an OBJ if the input begins with O, a .glb if with G, else a shape's name. An accepted one is met once in
// every direction from the nodal point, at a positive distance, and its inside and outside are told apart.
#include <cmath>
#include <random>
#include <string_view>

#include "memory_limit.h"
#include "protocol/base/crc32c.h"
#include "stitch/geometry/envelope/envelope.h"
#include "stitch/mesh/mesh_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  static const bool limited = (fuzz::limit_memory(std::size_t{64} << 20), true);
  (void)limited;
  if (size == 0 || size > (1U << 16)) return 0;
  const std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  const auto envelope = data[0] == 'O'   ? geometry::Envelope::from_obj(text)
                        : data[0] == 'G' ? mesh::decode_envelope({data + 1, size - 1})
                                         : geometry::Envelope::named(text);
  if (!envelope) {
    NODAL_ASSERT(!envelope.error().message.empty() && envelope.error().message.size() < 2000);
    return 0;
  }
  std::mt19937 random(crc32c({data, size}));
  std::normal_distribution<double> normal;
  for (int k = 0; k < 40; ++k) {
    // Also along axes, which the edges of many meshes are on.
    const auto along = [&](int axis) { return k % 4 == 0 && k / 4 % 3 != axis ? 0.0 : normal(random); };
    const Eigen::Vector3d drawn(along(0), along(1), along(2));
    const auto ray = geometry::Ray::towards(drawn);
    const double rho = envelope->rho(ray);
    NODAL_ASSERT(std::isfinite(rho) && rho > 0);
    const auto seen = envelope->seen(Eigen::Vector3d::Zero(), ray);
    NODAL_ASSERT(seen && (*seen - rho * ray.direction()).norm() <= 1e-9 * rho);
    const Eigen::Vector3d outside = 2 * rho * ray.direction();
    NODAL_ASSERT(envelope->check_eye(outside));
    const auto back = envelope->seen(outside, geometry::Ray::towards(-ray.direction()));
    NODAL_ASSERT(back && back->norm() <= 1.001 * rho);
  }
  return 0;
}
