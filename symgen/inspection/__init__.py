"""What a reader is shown of a scene: any matrix in any form, and the page that shows the whole of it."""
