// The vector loops behind contacts by distance fields. Raw pointers only: the file that implements them is compiled for
// several instruction sets, so neither Eigen nor a header that includes it may reach it.
//
// Points come in clusters of eight, x[8] y[8] z[8]. Every result is the same bits on every instruction set that has
// fused multiply-add.
#pragma once

#include <cstddef>
#include <cstdint>

namespace limber::internal {

inline constexpr std::size_t kFieldLanes = 8;
inline constexpr std::size_t kClusterFloats = 3 * kFieldLanes;
/// Rows of coordinates are computed so many at a time.
inline constexpr std::size_t kRowTile = 16;

/// Nodes of a regular grid: node (i, j, k) is number (i·count[1] + j)·count[2] + k.
struct GridView {
  float origin[3];         ///< of node 0, m
  float inverse[3];        ///< 1/m: of the sides of a cell
  float last[3];           ///< a little less than count − 1: what is beyond the grid is looked up on its border
  std::int32_t stride[2];  ///< nodes from i to i + 1, and from j to j + 1
};

/// A signed distance, negative inside, in one frame.
struct DistanceView {
  enum class Kind : std::uint8_t {
    kPlane,    ///< size · q − radius
    kSegment,  ///< of a ball or capsule: about (0, 0, ±size[2]), of `radius`
    kBox,      ///< half extents `size`
    kGrid,     ///< trilinear between nodes
  } kind = Kind::kGrid;
  float size[3] = {0.0f, 0.0f, 0.0f};
  float radius = 0.0f;
  GridView grid{};
  /// Per node its own distance, in the low 16 bits, and that of the next one along the third axis, in units of `unit`.
  const std::int32_t* nodes = nullptr;
  float unit = 0.0f;  ///< m
};

/// Displacements of a deformed body about its surface, trilinear between nodes.
struct LatticeView {
  GridView grid{};
  const float* nodes = nullptr;  ///< xyz of each, and one number more; null: nothing is displaced
  int steps = 0;                 ///< of r ← q − u(r), which carries a point back into the rest shape
};

/// Heights of points of a surface above a plane: now · x + base[0], and where they are expected at the step's end,
/// swung by u, then · x + now · u + base[1].
struct HeightView {
  float now[3] = {}, then[3] = {};
  float base[2] = {-3e38f, -3e38f};
};

/// What distances are asked of: a field and how the points lie in its frame, q = R x + p.
struct FieldQuery {
  DistanceView field{};
  LatticeView lattice{};
  float R[3][3] = {};  ///< rows
  float p[3] = {};
  float reach = 0.0f;  ///< m: distances up to here count, and farther ones as the points' own motion closes them along
                       ///< the slope, if it may bring them within reach
  /// Encloses the surface, in the field's frame, m.
  float low[3] = {-3e38f, -3e38f, -3e38f}, high[3] = {3e38f, 3e38f, 3e38f};
  /// How a point is expected to move in the field's frame until the step's end: turn x + shift + R u, u its swing.
  float turn[3][3] = {};
  float shift[3] = {};
  float turning = 0.0f;  ///< |turn|
  float curve = 0.0f;    ///< m: what turns strays no farther from the straight way
  float swing = 0.0f;    ///< m: no |u| is larger
  float fall[3] = {};    ///< or so much farther or less, in the field's frame
  /// The other surface stays below. What stays higher than `reach` and all that points may stray is out of reach:
  /// heights are exact, and begin above the plane by what these have for errors of the field and a fall aside.
  HeightView above{};
};

/// Clusters of eight in one state: balls that hold them.
struct ClusterView {
  const float* centres = nullptr;  ///< by eights of clusters, x[8] y[8] z[8]
  const float* radii = nullptr;    ///< m; negative: no cluster
  std::size_t groups = 0;          ///< of eight clusters
};

/// A surface's samples and edges in one state.
struct ShellView {
  const float* coordinates = nullptr;  ///< of samples, by cluster
  const float* swings = nullptr;       ///< how modes are expected to move these, m; null: they do not
  std::size_t clusters = 0;            ///< of samples
  ClusterView samples{}, edges{};
  /// Per cluster of edges, the samples at their first eight ends, then at their second. Sample s is lane s mod 8 of
  /// cluster s div 8.
  const std::int32_t* edge_ends = nullptr;
};

/// Per sample of one surface, with room for whole groups of clusters. Where its cluster is far off, bounds take the
/// place of its own numbers, and the slope is not a number.
///
/// A point that goes straight from where the distance is d to where it is d', a way of m, stays (d + d' − m)/2 clear of
/// the surface at least, as distances change by no more than the way.
struct SampleBounds {
  float* distance = nullptr;  ///< m: from the other surface, negative inside; or less than that, outside
  float* clear = nullptr;     ///< m: outside, it stays so far from the surface at least; inside, it is so far from it
  float* slope = nullptr;     ///< of the distance, by cluster: x[8] y[8] z[8], in the field's frame
};

/// A sample or a point of an edge near a field's surface.
struct FieldHit {
  std::int32_t feature;  ///< number of the sample or edge, by their order in the clusters
  float along;           ///< of an edge, 0 to 1 from its first end
  float distance;        ///< m, of the field
  float at[3];           ///< in the field's frame, m
  float rest[3];         ///< the same point carried back into the rest shape
  float slope[3];        ///< of the distance; not of unit length
};

/// The largest number of hits that a query of so many clusters or edges has.
inline constexpr std::size_t kHitsOfCluster = kFieldLanes;
inline constexpr std::size_t kHitsOfEdge = 96;

/// Coordinates of up to `kBodiesAtOnce` bodies of one geometry: out[b] = rest + U z[b].
/// @param U tiles of kRowTile rows, [tile][mode][kRowTile] @param rest, out 64-byte aligned
inline constexpr std::size_t kBodiesAtOnce = 4;
void multiply_rows(const float* rest, const float* U, std::size_t tiles, std::size_t modes, const float* const* z,
                   float* const* out, std::size_t bodies);

/// The largest distance of a point of `count` clusters from that of the others.
float largest_distance(const float* clusters, const float* others, std::size_t count);

/// The largest |v| of each axis over `count` points xyz xyz …
void largest_magnitudes(const float* points, std::size_t count, float largest[3]);

/// The lowest samples of a surface, now and at the step's end; the first of those that are as low.
struct LowestSamples {
  float height[2];
  std::int32_t sample[2];
};
LowestSamples lowest_samples(const ShellView& shell, const HeightView& heights);

/// Box about balls about the clusters' centres. @param radii as many as lanes of `groups`; negative: none
void box_of_clusters(const ClusterView& clusters, float low[3], float high[3]);

/// Clusters that may have something within reach, or come there. @param found room for 8 · groups @return how many
/// @param bounds null members: not asked for; otherwise those of all samples, by what their clusters tell
std::size_t near_clusters(const FieldQuery& query, const ClusterView& clusters, std::uint32_t* found,
                          const SampleBounds& bounds = {});

/// Samples of clusters that are within reach, or may come there. @param hits room for kHitsOfCluster each @return how
/// many @param bounds null members: not asked for; otherwise those of the clusters' samples
std::size_t near_samples(const FieldQuery& query, const ShellView& shell, const std::uint32_t* clusters,
                         std::size_t count, FieldHit* hits, const SampleBounds& bounds = {});

/// Points of edges at which the distance along them changes its sign, or falls no longer or begins to rise where it is
/// within reach or comes there, those at the ends excepted. Of each half of an edge the distances and slopes at its two
/// ends tell whether it may have such a point; then the field is looked at in steps of `step`, or of a 48th of the
/// edge.
/// @param ends bounds of all samples @param step m: of a cell @param hits room for 8 · kHitsOfEdge each
std::size_t near_edges(const FieldQuery& query, const ShellView& shell, const SampleBounds& ends,
                       const std::uint32_t* clusters, std::size_t count, float step, FieldHit* hits);

/// Where a straight way from an inside point first leaves: the part of it as `along`, and the field just outside.
/// @param step see near_edges() @return false: nowhere on it
bool first_exit(const FieldQuery& query, const float from[3], const float to[3], float step, FieldHit& exit);

/// The distance at one point, for tests and for what is asked one by one.
FieldHit field_at(const FieldQuery& query, const float x[3]);

}  // namespace limber::internal
