// Which way is up by how a rig's heads stand and are held, without a look at what they show.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace nodal::autocalibration {

/// What decides which way is up.
enum class UpBasis : std::uint8_t {
  kEdges,  ///< vertical edges or the horizon, all around
  kRing,   ///< the axis of the ring that the heads form
  kHeld,   ///< how the pictures are held
  kLight,  ///< where the light comes from, and edges that agree with it: a guess
};

/// A head's axes in the rig's frame, length 1.
struct HeldHead {
  Eigen::Vector3d forward;
  Eigen::Vector3d up;  ///< up in its picture as people look at it (Exif orientation applied)
};

/// The axis of a ring: the heads look all around it, at right angles to it or, if there are four or more, all at one
/// angle. Some heads may look along it. Of its two directions, the one that is upwards in most pictures; if pictures
/// lie on their side, the one nearer to `light`. Nothing if the heads form no ring, or more than one.
std::optional<Eigen::Vector3d> ring_up(const std::vector<HeldHead>& heads, const Eigen::Vector3d& light);

/// Up, if the heads are held upright: the direction that is upwards in their pictures, level with their rows, and not
/// far from a right angle to where they look. Nothing if the pictures contradict each other, as those of a rig with
/// heads in every direction.
std::optional<Eigen::Vector3d> held_up(const std::vector<HeldHead>& heads);

}  // namespace nodal::autocalibration
