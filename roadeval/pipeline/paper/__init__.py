"""The paper's pipeline: one file a phase, its name the stage's name.

| equation | what | function |
|---|---|---|
| 2 | Mahalanobis distance to the road's colour | `similarity.bind`, `similarity.fit` |
| 3 | value | `hsi.value` |
| 4 | saturation | `hsi.saturation` |
| 5 | hue | `hsi.hue` |
| 6 | NDI | `shadow_mask.ndi` |
| 7 | Otsu's threshold | `shadow_mask.otsu_threshold`, `shadow_mask.printed_threshold` |
| 8 | shadow mask | `shadow_mask.shadow_mask` |
| 9 | connected components | `compensation.connected_components` |
| 10 | buffer rings | `compensation.buffer_ring`, `compensation.ring_pairs` |
| 11 | compensation | `compensation.compensation`, `compensation.compensate` |
| 12-16 | support vector machine | `svm.fit` (14), `svm.decision` (15, 16) |
| 17 | dilation | `post.dilate` |
| 18 | erosion | `post.erode` |
| 20 | opening | `post.opening` |
| 21 | closing | `post.closing` |
| 22 | boundary | `post.boundary` |
| 23 | holes | `post.fill_holes` |
| 24-29 | rates | in the room roadeval.evaluation |
"""
