// Which plane keeps two surfaces apart where they are next to each other's rims: the rules of NarrowPhase, for contacts
// by distance fields.
#pragma once

#include "field/field_pair.h"

namespace limber::internal {

/// How a sample is expected to move against a foot on the other surface, field's frame, m.
Vec3f expected_motion(const FieldView& view, Index vertex, const SurfaceFoothold& foot);

/// Next to a rim, the direction to the nearest point is noise, or leads to a face that the sample's own surface runs
/// through. A face next to it on which that surface lies is taken in its place: what stands flush on another is borne
/// by its face.
void rest_on_face(const FieldView& view, SampleFoot& sample);

/// A contact stands for a plane, which may end where it was found: what moves along the top of a box is not to be
/// stopped by the plane of its side, nor by the next box's. Where the expected motion would pass the plane, that of a
/// face of either body next to it is taken if it is passed less.
/// @param passed m, by how much a plane may have been passed and still keeps the bodies apart
/// @return false: the other plane is not passed, so that the two do not meet
bool unhindered(const FieldView& view, SampleFoot& sample, float passed);

}  // namespace limber::internal
