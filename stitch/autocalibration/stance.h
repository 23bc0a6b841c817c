// Finds up from the heads' orientations alone, without their pictures.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

namespace nodal::autocalibration {

/// What decides which way is up.
enum class UpBasis : std::uint8_t {
  kEdges,     ///< vertical edges or the horizon, all around
  kRing,      ///< the axis of the ring that the heads form
  kHeld,      ///< how the pictures are held
  kMajority,  ///< how most pictures are held
  kLight,     ///< where the light comes from, and edges that agree with it: a guess
};

/// A head's axes in the rig's frame, length 1.
struct HeldHead {
  Eigen::Vector3d forward;
  Eigen::Vector3d up;  ///< up in its picture as people look at it (Exif orientation applied)
};

/// The axis of a ring of heads, as up. The heads look all around it, at right angles or, if there are four or more, all
/// at one other angle; some heads may look along it. The axis points upwards in most pictures, or towards `light` if
/// pictures lie on their side. Nothing if the heads form no ring, or several.
std::optional<Eigen::Vector3d> ring_up(const std::vector<HeldHead>& heads, const Eigen::Vector3d& light);

/// Up, if the heads are held upright: the direction that is upwards in their pictures, perpendicular to their rows and
/// about perpendicular to their axes. Nothing if the pictures contradict each other, such as those of a rig with heads
/// in every direction.
std::optional<Eigen::Vector3d> held_up(const std::vector<HeldHead>& heads);

/// The same for the largest group of pictures that do not contradict each other, if it is more than half of them.
std::optional<Eigen::Vector3d> mostly_held_up(const std::vector<HeldHead>& heads);

}  // namespace nodal::autocalibration
